#include <cstdlib>
#include <string>

#include "tileflight/live/airsim/airsim_methods.h"
#include "tileflight/live/airsim/test_null_simulator_caller.h"
#include "tileflight/live/rpc/message_scanner.h"

namespace {

using namespace tileflight;

rpc::MethodTable make_table() {
  rpc::MethodTable table;
  airsim::MethodBinder<airsim::NullSimulatorCaller> bind(table, {});
  airsim::add_airsim_methods(bind);
  airsim::add_extension_methods(bind, [] { return rpc::ServerStatistics{}; });
  return table;
}

void answer(const rpc::MethodTable& table, const rpc::MessageLimits& limits, const std::string& message) {
  const rpc::Request request(message);
  const std::string bytes = table.call(request).bytes;
  if (rpc::MessageScanner(limits).find_message_end(bytes) != bytes.size())
    std::abort();  // every answer is one whole message
}

}  // namespace

/// A connection's bytes: cut into messages, decoded, called, answered.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const rpc::MethodTable table = make_table();
  const rpc::MessageLimits limits;
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  try {
    rpc::MessageScanner scanner(limits);
    while (const auto bytes = scanner.find_message_end(rest)) {
      answer(table, limits, std::string(rest.substr(0, *bytes)));
      rest.remove_prefix(*bytes);
      scanner.restart();
    }
  } catch (const rpc::ProtocolError&) {
    // the connection is closed
  }
  return 0;
}
