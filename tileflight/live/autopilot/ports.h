#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace tileflight::autopilot {

/// A UDP port that this program listens on and answers from.
class UdpPort {
 public:
  /// `port` 0: any free one. Throws InputError if the address is none of this machine, or the port is taken.
  UdpPort(const std::string& address, std::uint16_t port);
  ~UdpPort();
  UdpPort(const UdpPort&) = delete;
  UdpPort& operator=(const UdpPort&) = delete;

  std::uint16_t port() const;
  /// Returns the next datagram (cut after 2 KiB), or nullopt if none comes in time.
  std::optional<std::string> receive(std::chrono::milliseconds patience);
  /// Sends a datagram to the sender of the last one received. One that cannot be sent is lost, as any may be.
  void answer(std::string_view bytes);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A TCP port that this program listens on, for one peer at a time. While one is connected, others wait in the queue.
class TcpPort {
 public:
  /// `port` 0: any free one. Throws InputError if the address is none of this machine, or the port is taken.
  TcpPort(const std::string& address, std::uint16_t port);
  ~TcpPort();
  TcpPort(const TcpPort&) = delete;
  TcpPort& operator=(const TcpPort&) = delete;

  std::uint16_t port() const;
  /// Waits for a peer and ends the connection of the last one. Returns false if none comes in time.
  bool accept(std::chrono::milliseconds patience);
  bool connected() const;
  /// Returns bytes that the peer has sent, at most 64 KiB; empty if none arrive in time, or the connection has ended.
  std::string receive(std::chrono::milliseconds patience);
  /// Sends bytes. The connection ends if the peer does not read for a second.
  void send(std::string_view bytes);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

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
  /// Returns the vehicle's port and opens it if necessary. Throws InputError if that fails.
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
