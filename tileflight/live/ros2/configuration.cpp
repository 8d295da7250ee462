// Elements: https://github.com/eclipse-cyclonedds/cyclonedds/blob/releases/0.10.x/docs/manual/options.md
#include "tileflight/live/ros2/configuration.h"

#include <algorithm>
#include <cctype>

#include "tileflight/core/base/input_error.h"

namespace tileflight::ros2 {
namespace {

std::string domain(const std::string& elements) {
  return "<CycloneDDS><Domain Id=\"any\">" + elements + "</Domain></CycloneDDS>";
}

/// Writers keep the last few messages also of those that are not acknowledged, so that their number is the limit; the
/// high-water mark would stop all readers' messages for the slowest one.
const char* const kLimits =
    "<Internal><Watermarks><WhcHigh>1 GB</WhcHigh><WhcHighInit>1 GB</WhcHighInit></Watermarks>"
    "<MaxSampleSize>256 MB</MaxSampleSize></Internal>";

/// Without multicast, others are found by what is sent to the ports that they may have, which they answer: often, as
/// who has just come has missed it so far. Large datagrams are cheap where nothing loses a part of them; the MTU of
/// loopback is 64 KiB.
const char* const kLoopback =
    "<General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces><AllowMulticast>false</AllowMulticast>"
    "<MaxMessageSize>65000 B</MaxMessageSize><FragmentSize>60000 B</FragmentSize></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>"
    "<SPDPInterval>1 s</SPDPInterval><Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>";

const char* const kNoSharedMemory = "<SharedMemory><Enable>false</Enable></SharedMemory>";

bool is_address(const std::string& name) {
  return name.find_first_not_of("0123456789.") == std::string::npos || name.find(':') != std::string::npos;
}

std::string interface_elements(const std::string& name) {
  const bool is_valid = name.size() < 64 && std::ranges::all_of(name, [](char c) {
                          return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                                 std::string_view("._-:@").find(c) != std::string_view::npos;
                        });
  if (!is_valid)
    throw InputError("--ros2-interface",
                     "'" + name.substr(0, 100) + "' is no name or address of an interface (see `ip address`)");
  const std::string key = is_address(name) ? "address" : "name";
  return "<General><Interfaces><NetworkInterface " + key + "=\"" + name + "\"/></Interfaces></General>";
}

}  // namespace

/// Later parts take precedence.
std::string configuration(const std::string& interface_name, const std::string& cyclonedds_uri) {
  std::string parts = domain(kLimits) + ",";
  if (!interface_name.empty()) {
    parts += domain(interface_elements(interface_name));
  } else {
    parts += cyclonedds_uri.empty() ? domain(kLoopback) : cyclonedds_uri;
  }
  return parts + "," + domain(kNoSharedMemory);
}

}  // namespace tileflight::ros2
