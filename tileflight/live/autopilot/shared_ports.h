#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "tileflight/live/autopilot/ports.h"

namespace tileflight::autopilot {

/// A port used by several owners in turn: the reader holds `in_use`.
template <class Port>
struct SharedPort {
  SharedPort(const std::string& address, std::uint16_t number) : port(address, number) {}

  Port port;
  std::mutex in_use;
};

/// The ports at which vehicles wait for their autopilots. They stay open while worlds come and go: the same vehicle of
/// another world gets the same port, and uses it once the one before has let it go. Thread-safe.
class SharedPorts {
 public:
  /// The vehicle's port, opened if it is not yet. Throws InputError if it cannot be.
  std::shared_ptr<SharedPort<UdpPort>> udp(const std::string& vehicle, const std::string& address, std::uint16_t port) {
    return get(udp_, vehicle, address, port);
  }
  std::shared_ptr<SharedPort<TcpPort>> tcp(const std::string& vehicle, const std::string& address, std::uint16_t port) {
    return get(tcp_, vehicle, address, port);
  }

 private:
  template <class Port>
  using Ports = std::map<std::pair<std::string, std::uint16_t>, std::shared_ptr<SharedPort<Port>>>;

  template <class Port>
  std::shared_ptr<SharedPort<Port>> get(Ports<Port>& ports, const std::string& vehicle, const std::string& address,
                                        std::uint16_t port) {
    const std::lock_guard lock(mutex_);
    auto& found = ports[{vehicle, port}];
    if (!found) found = std::make_shared<SharedPort<Port>>(address, port);
    return found;
  }

  std::mutex mutex_;
  Ports<UdpPort> udp_;
  Ports<TcpPort> tcp_;
};

}  // namespace tileflight::autopilot
