#pragma once

#include <cstdint>
#include <string>

namespace tileflight::ros2 {

/// Configuration of CycloneDDS, as its XML: networks and limits.
///
/// - `interface_name` given ("eth0", or an address of this machine): that interface alone, with multicast if it has it.
/// - else, what `cyclonedds_uri` (the environment's CYCLONEDDS_URI, a file or XML) says, if it is not empty;
/// - else this machine alone: 127.0.0.1, and as loopback has no multicast, other participants are looked for at the
///   first 32 ports of the domain.
///
/// In all cases a reader that does not keep up makes no writer wait: as writers keep a few messages and no more, the
/// bytes that wait are bounded without. Shared memory is off. Throws InputError for a name that is none.
std::string configuration(const std::string& interface_name, const std::string& cyclonedds_uri);

inline constexpr std::uint32_t kMaxDomain = 232;  ///< the last that has ports (RTPS 2.2, section 9.6.1)

}  // namespace tileflight::ros2
