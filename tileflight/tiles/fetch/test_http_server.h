#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

/// A small HTTP/1.1 server on the loopback device, over plain sockets, so that tests can simulate faulty servers.
namespace tileflight::fetch::test_support {

struct ServedRequest {
  std::string method;
  std::string target;                          ///< path and query
  std::map<std::string, std::string> headers;  ///< names in lower case

  std::string path() const { return target.substr(0, target.find('?')); }
  std::string header(const std::string& name) const {
    const auto it = headers.find(name);
    return it == headers.end() ? "" : it->second;
  }
};

class TestHttpServer;

/// A connection, as seen by its handler.
class ServedConnection {
 public:
  ServedConnection(int socket, TestHttpServer& server) : socket_(socket), server_(server) {}

  /// False: the client has disconnected.
  bool send(const std::string& bytes) {
    for (std::size_t done = 0; done < bytes.size();) {
      const ssize_t count = ::send(socket_, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
      if (count <= 0) return false;
      done += static_cast<std::size_t>(count);
    }
    return true;
  }

  /// Sends a whole response with its length.
  bool answer(int status, const std::string& body, const std::vector<std::string>& headers = {}) {
    std::string head = "HTTP/1.1 " + std::to_string(status) + " Status\r\n";
    for (const std::string& header : headers) head += header + "\r\n";
    if (status != 304) head += "Content-Length: " + std::to_string(body.size()) + "\r\n";
    return send(head + "\r\n" + body);
  }

  /// Waits, but not beyond the server's lifetime.
  void wait(std::chrono::milliseconds time);
  /// Ends the connection with a reset instead of a close.
  void reset_at_end() { reset_ = true; }
  bool resets() const { return reset_; }
  bool read_more(std::string& buffer) {
    char bytes[4096];
    const ssize_t count = recv(socket_, bytes, sizeof bytes, 0);
    if (count <= 0) return false;
    buffer.append(bytes, static_cast<std::size_t>(count));
    return true;
  }

 private:
  int socket_;
  TestHttpServer& server_;
  bool reset_ = false;
};

class TestHttpServer {
 public:
  /// Answers a request; returns false to close the connection. Called from several threads at once.
  using Handler = std::function<bool(const ServedRequest&, ServedConnection&)>;

  explicit TestHttpServer(Handler handler) : handler_(std::move(handler)) {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    const bool ready = bind(listener_, reinterpret_cast<sockaddr*>(&address), length) == 0 &&
                       listen(listener_, 128) == 0 &&
                       getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length) == 0;
    if (!ready) throw std::runtime_error("the test server cannot listen");
    port_ = ntohs(address.sin_port);
    acceptor_ = std::thread([this] { accept_all(); });
  }
  TestHttpServer(const TestHttpServer&) = delete;
  TestHttpServer& operator=(const TestHttpServer&) = delete;

  ~TestHttpServer() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      for (const int socket : open_) shutdown(socket, SHUT_RDWR);
    }
    stopped_.notify_all();
    shutdown(listener_, SHUT_RDWR);
    acceptor_.join();
    for (std::thread& thread : threads_) thread.join();
    close(listener_);
  }

  int port() const { return port_; }
  std::string host() const { return "127.0.0.1:" + std::to_string(port_); }
  std::string url(const std::string& path) const { return "http://" + host() + path; }

  std::vector<ServedRequest> requests() const {
    const std::lock_guard lock(mutex_);
    return requests_;
  }
  int count(const std::string& path) const {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(
        std::count_if(requests_.begin(), requests_.end(), [&](const ServedRequest& r) { return r.path() == path; }));
  }
  int connections() const { return connections_; }
  int most_at_once() const { return most_at_once_; }

  void wait(std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    stopped_.wait_for(lock, time, [this] { return stopping_; });
  }

 private:
  void accept_all() {
    while (true) {
      const int socket = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      if (socket < 0) return;
      const int at_once = 1;
      setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
      const std::lock_guard lock(mutex_);
      if (stopping_) {
        close(socket);
        return;
      }
      ++connections_;
      open_.push_back(socket);
      threads_.emplace_back([this, socket] { serve(socket); });
    }
  }

  void serve(int socket) {
    ServedConnection connection(socket, *this);
    std::string buffer;
    ServedRequest request;
    while (read_request(connection, buffer, request)) {
      const int now = ++at_once_;
      most_at_once_ = std::max(most_at_once_.load(), now);
      const bool keep = handler_(request, connection);
      --at_once_;
      if (!keep) break;
    }
    if (connection.resets()) {
      const linger now{.l_onoff = 1, .l_linger = 0};
      setsockopt(socket, SOL_SOCKET, SO_LINGER, &now, sizeof now);
    }
    const std::lock_guard lock(mutex_);
    std::erase(open_, socket);
    close(socket);
  }

  bool read_request(ServedConnection& connection, std::string& buffer, ServedRequest& request) {
    std::size_t end = 0;
    while ((end = buffer.find("\r\n\r\n")) == std::string::npos) {
      if (!connection.read_more(buffer)) return false;
    }
    request = parsed(buffer.substr(0, end));
    buffer.erase(0, end + 4);
    const std::lock_guard lock(mutex_);
    requests_.push_back(request);
    return !stopping_;
  }

  static ServedRequest parsed(const std::string& head) {
    ServedRequest request;
    std::size_t line_end = head.find("\r\n");
    const std::string first = head.substr(0, line_end);
    const std::size_t space = first.find(' ');
    request.method = first.substr(0, space);
    request.target = first.substr(space + 1, first.rfind(' ') - space - 1);
    while (line_end != std::string::npos) {
      const std::size_t start = line_end + 2;
      line_end = head.find("\r\n", start);
      const std::string line = head.substr(start, line_end == std::string::npos ? line_end : line_end - start);
      std::string name = line.substr(0, line.find(':'));
      std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
      if (line.find(": ") != std::string::npos) request.headers[name] = line.substr(line.find(": ") + 2);
    }
    return request;
  }

  Handler handler_;
  int listener_ = -1;
  int port_ = 0;
  std::thread acceptor_;
  std::atomic<int> connections_ = 0;
  std::atomic<int> at_once_ = 0;
  std::atomic<int> most_at_once_ = 0;
  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable stopped_;
  std::vector<std::thread> threads_;
  std::vector<int> open_;
  std::vector<ServedRequest> requests_;
  bool stopping_ = false;
};

inline void ServedConnection::wait(std::chrono::milliseconds time) { server_.wait(time); }

}  // namespace tileflight::fetch::test_support
