#include "tileflight/live/ros2/topics.h"

#include <dds/dds.h>

#include <exception>
#include <utility>

#include "tileflight/live/ros2/entities.h"
#include "tileflight/live/ros2/raw_type.h"

namespace tileflight::ros2 {

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
