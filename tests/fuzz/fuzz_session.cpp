#include <cmath>
#include <cstdlib>
#include <variant>

#include "tests/fuzz/memory_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/airsim/session.h"

namespace {

using namespace tileflight;

/// Checks the properties that a repetition relies on.
void check(const airsim::SessionRecord& record) {
  if (const auto* call = std::get_if<airsim::RecordedCall>(&record)) {
    if (call->tick < 0 || call->tick > airsim::kMaxTick) std::abort();
  } else if (const auto* answer = std::get_if<airsim::RecordedAnswer>(&record)) {
    if (answer->tick < 0 || answer->tick > airsim::kMaxTick) std::abort();
  } else if (const auto* end = std::get_if<airsim::RecordedEnd>(&record)) {
    if (end->tick < 0 || end->tick > airsim::kMaxTick) std::abort();
  } else if (const auto* event = std::get_if<airsim::RecordedEvent>(&record)) {
    const simulator::AutopilotEvent& one = event->event;
    if (one.tick < 0 || one.tick > airsim::kMaxTick || one.outputs.size() > 64 || !std::isfinite(one.time_s) ||
        !(one.step_s >= 0.0 && one.step_s <= 1.0))
      std::abort();
  }
}

}  // namespace

/// A file of `serve --record`, of any bytes, as `serve --replay` reads it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::MemoryFile file(data, size);
  try {
    airsim::SessionReader reader(file.path());
    std::size_t records = 0;
    while (const auto record = reader.next()) {
      check(*record);
      if (++records > size) std::abort();  // each takes bytes
    }
  } catch (const InputError&) {
    // refused in one line
  }
  return 0;
}
