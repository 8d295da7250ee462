#include "tileflight/live/ros2/topics.h"

#include <dds/dds.h>

#include <atomic>
#include <exception>
#include <utility>

#include "tileflight/live/ros2/entities.h"
#include "tileflight/live/ros2/raw_type.h"

namespace tileflight::ros2 {
namespace {

using ListenerPointer = std::unique_ptr<dds_listener_t, decltype(&dds_delete_listener)>;

}  // namespace

struct Publisher::Impl {
  Impl(Participant& of, const std::string& topic, const std::string& type, const QualityOfService& quality)
      : participant(of), listener(dds_create_listener(this), dds_delete_listener) {
    dds_lset_publication_matched(listener.get(), &Impl::on_match);
    const Entity::Options options{dds_topic(valid_name(topic)), dds_type(type), quality, {}};
    writer = std::make_unique<Entity>(participant, Participant::Kind::kWriter, options, listener.get());
  }
  ~Impl() {
    writer.reset();  // after which there are no calls of the listener
    participant.count_readers(-readers.load());
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  static void on_match(dds_entity_t /*writer*/, const dds_publication_matched_status_t status, void* self) {
    auto& impl = *static_cast<Impl*>(self);
    impl.readers += status.current_count_change;
    impl.participant.count_readers(status.current_count_change);
  }

  Participant& participant;
  std::atomic<std::int32_t> readers{0};
  std::atomic<std::uint64_t> sent{0};
  ListenerPointer listener;
  std::unique_ptr<Entity> writer;
};

Publisher::Publisher(Participant& participant, const std::string& topic, const std::string& type,
                     const QualityOfService& quality)
    : impl_(std::make_unique<Impl>(participant, topic, type, quality)) {}

Publisher::~Publisher() = default;

bool Publisher::has_readers() const { return impl_->readers > 0; }

void Publisher::publish(std::string cdr) {
  if (impl_->writer->write(std::move(cdr))) ++impl_->sent;
}

void Publisher::wait_until_acknowledged(std::chrono::milliseconds limit) const {
  dds_wait_for_acks(impl_->writer->handle(), std::chrono::nanoseconds(limit).count());
}

std::uint64_t Publisher::sent() const { return impl_->sent; }

struct Subscription::Impl {
  Impl(Participant& of, std::string topic, const std::string& type, const QualityOfService& quality, Handler to,
       std::size_t max_bytes)
      : participant(of), name(std::move(topic)), handler(std::move(to)) {
    const std::unique_ptr<dds_listener_t, decltype(&dds_delete_listener)> listener(dds_create_listener(this),
                                                                                   dds_delete_listener);
    dds_lset_data_available(listener.get(), &Impl::on_data);
    const Entity::Options options{dds_topic(valid_name(name)), dds_type(type), quality, {}, max_bytes};
    reader = std::make_unique<Entity>(participant, Participant::Kind::kReader, options, listener.get());
  }

  static void on_data(dds_entity_t entity, void* self) {
    take_all(entity,
             [&](const RawMessage& message, std::uint64_t /*sender*/) { static_cast<Impl*>(self)->handle(message); });
  }

  void handle(const RawMessage& message) try {
    if (message.is_too_large) return participant.report(name + ": a message is too large and is left out");
    handler(message.cdr);
  } catch (const std::exception& error) {
    participant.report(error.what());
  }

  Participant& participant;
  std::string name;
  Handler handler;
  std::unique_ptr<Entity> reader;
};

Subscription::Subscription(Participant& participant, const std::string& topic, const std::string& type,
                           const QualityOfService& quality, Handler handler, std::size_t max_bytes)
    : impl_(std::make_unique<Impl>(participant, topic, type, quality, std::move(handler), max_bytes)) {}

Subscription::~Subscription() = default;

}  // namespace tileflight::ros2
