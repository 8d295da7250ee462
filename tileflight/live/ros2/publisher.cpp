#include "tileflight/live/ros2/publisher.h"

#include <dds/dds.h>

#include <atomic>
#include <utility>

#include "tileflight/live/ros2/entities.h"

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

}  // namespace tileflight::ros2
