#include "tileflight/live/ros2/service.h"

#include <dds/dds.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/cdr.h"
#include "tileflight/live/ros2/entities.h"
#include "tileflight/live/ros2/raw_type.h"

// https://github.com/ros2/rmw_cyclonedds: how clients and services find each other and their messages.

namespace tileflight::ros2 {
namespace {

constexpr std::size_t kHeader = 4, kIdentity = 16;

}  // namespace

ServiceMessage read_service_message(std::string_view cdr, const std::string& what) {
  if (cdr.size() < kHeader + kIdentity)
    throw InputError(what, "a request does not say whose it is; clients need RMW_IMPLEMENTATION=rmw_cyclonedds_cpp");
  messages::CdrReader reader(cdr, what);
  ServiceMessage message;
  message.client = reader.number<std::uint64_t>();
  message.sequence_number = reader.number<std::int64_t>();
  message.body = std::string(cdr.substr(0, kHeader)).append(cdr.substr(kHeader + kIdentity));
  return message;
}

std::string write_service_message(const ServiceMessage& message) {
  messages::CdrWriter writer;
  writer.number(message.client).number(message.sequence_number);
  return writer.bytes() + message.body.substr(kHeader);
}

namespace {

using Endpoint = std::unique_ptr<dds_builtintopic_endpoint_t, decltype(&dds_builtintopic_free_endpoint)>;

constexpr std::size_t kMaxWaiting = 16;
constexpr std::chrono::seconds kClientsReader{5};

struct Request {
  ServiceMessage message;
  std::uint64_t sender = 0;  ///< dds_instance_handle_t of the client's writer
};

/// Names the service's reader and writer as one: 16 octets as hexadecimal numbers.
std::string service_id(const Participant& participant, const std::string& name) {
  dds_guid_t guid{};
  dds_get_guid(participant.handle(), &guid);
  const std::size_t number = std::hash<std::string>{}(name);
  std::string text;
  for (std::size_t i = 0; i < sizeof guid.v; ++i) {
    const unsigned octet = i < 8 ? guid.v[i] : (number >> (8 * (i - 8))) & 0xFFU;
    std::array<char, 8> part{};
    std::snprintf(part.data(), part.size(), "%s%x", i == 0 ? "" : ".", octet);
    text += part.data();
  }
  return "serviceid=" + text + ";";
}

/// Returns the "clientid" in an endpoint's user data ("clientid=…;typehash=…;"); empty: none.
std::string client_id(const dds_builtintopic_endpoint_t& endpoint) {
  void* data = nullptr;
  std::size_t size = 0;
  if (!dds_qget_userdata(endpoint.qos, &data, &size) || data == nullptr) return {};
  const std::string text(static_cast<const char*>(data), size);
  dds_free(data);
  const std::string key = "clientid=";
  const std::size_t begin = text.find(key);
  if (begin == std::string::npos) return {};
  return text.substr(begin + key.size(), text.find(';', begin) - begin - key.size());
}

/// Returns whether the reader of the client with that writer has been discovered, which may happen after the request. A
/// client that does not name itself counts as discovered.
bool is_reader_known(const Entity& requests, const Entity& replies, std::uint64_t client) {
  const Endpoint sender(dds_get_matched_publication_data(requests.handle(), client), dds_builtintopic_free_endpoint);
  if (!sender) return true;  // gone
  const std::string wanted = client_id(*sender);
  if (wanted.empty()) return true;
  std::array<dds_instance_handle_t, 256> readers{};
  const dds_return_t count = dds_get_matched_subscriptions(replies.handle(), readers.data(), readers.size());
  for (std::size_t i = 0; i < readers.size() && static_cast<dds_return_t>(i) < count; ++i) {
    const Endpoint one(dds_get_matched_subscription_data(replies.handle(), readers[i]), dds_builtintopic_free_endpoint);
    if (one && client_id(*one) == wanted) return true;
  }
  return false;
}

}  // namespace

struct Service::Impl {
  Impl(Participant& of, const std::string& service, const std::string& type, Handler to)
      : participant(of), name(valid_name(service)), handler(std::move(to)) {
    const std::string id = service_id(participant, name);
    const Entity::Options reply{dds_reply_topic(name), dds_response_type(type), {}, id};
    replies = std::make_unique<Entity>(participant, Participant::Kind::kWriter, reply, nullptr);
    const std::unique_ptr<dds_listener_t, decltype(&dds_delete_listener)> listener(dds_create_listener(this),
                                                                                   dds_delete_listener);
    dds_lset_data_available(listener.get(), &Impl::on_data);
    const Entity::Options request{dds_request_topic(name), dds_request_type(type), {}, id};
    requests = std::make_unique<Entity>(participant, Participant::Kind::kReader, request, listener.get());
    thread = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  static void on_data(dds_entity_t entity, void* self) {
    take_all(entity, [&](const RawMessage& message, std::uint64_t sender) {
      static_cast<Impl*>(self)->queue(message, sender);
    });
  }

  void queue(const RawMessage& message, std::uint64_t sender) try {
    Request request{read_service_message(message.cdr, name), sender};
    const std::lock_guard lock(mutex);
    if (waiting.size() >= kMaxWaiting) return participant.report(name + ": too many requests wait, some are left out");
    waiting.push_back(std::move(request));
    came.notify_all();
  } catch (const std::exception& error) {
    participant.report(error.what());
  }

  void run(const std::stop_token& stop) {
    while (const std::optional<Request> request = next(stop)) {
      try {
        answer(*request, stop);
      } catch (const std::exception& error) {
        participant.report(name + ": " + error.what());
      }
    }
  }

  std::optional<Request> next(const std::stop_token& stop) {
    std::unique_lock lock(mutex);
    if (!came.wait(lock, stop, [this] { return !waiting.empty(); })) return std::nullopt;
    Request request = std::move(waiting.front());
    waiting.pop_front();
    return request;
  }

  void answer(const Request& request, const std::stop_token& stop) {
    const std::string response = handler(request.message.body);
    const auto end = std::chrono::steady_clock::now() + kClientsReader;
    while (!is_reader_known(*requests, *replies, request.sender) && std::chrono::steady_clock::now() < end) {
      if (stop.stop_requested()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    replies->write(write_service_message({request.message.client, request.message.sequence_number, response}));
  }

  Participant& participant;
  std::string name;
  Handler handler;
  std::mutex mutex;  ///< guards `waiting`
  std::condition_variable_any came;
  std::deque<Request> waiting;
  std::unique_ptr<Entity> replies, requests;
  std::jthread thread;
};

Service::Service(Participant& participant, const std::string& name, const std::string& type, Handler handler)
    : impl_(std::make_unique<Impl>(participant, name, type, std::move(handler))) {}

/// The thread may be in the handler until that returns.
Service::~Service() {
  impl_->thread = {};
  impl_->requests.reset();
}

}  // namespace tileflight::ros2
