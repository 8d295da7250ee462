#pragma once

struct dds_listener;
struct ddsi_sertype;

#include <cstddef>
#include <cstdint>
#include <string>

#include "tileflight/live/ros2/participant.h"

namespace tileflight::ros2 {

/// The parts of DDS's quality of service that ROS 2's nodes choose and compare.
struct QualityOfService {
  /// A reliable writer serves readers that ask for reliability and those that do not; a best-effort writer only the
  /// latter. A best-effort reader takes from both.
  bool is_reliable = true;
  bool is_latched = false;   ///< transient local: later subscribers get the last message
  std::uint32_t depth = 10;  ///< "keep last": how many messages wait for a reader, at most
};

// Creation of readers and writers, for this room.

/// An entity of DDS with its topic, deleted with it.
class Entity {
 public:
  /// `user_data`: what others see of it ("serviceid=…;"), may be empty. `max_bytes`: of a received message. Throws
  /// InputError (topic, cause).
  struct Options {
    std::string topic, type;  ///< DDS's names
    QualityOfService quality;
    std::string user_data;
    std::size_t max_bytes = std::size_t{64} << 10U;
  };
  Entity(Participant& participant, Participant::Kind kind, const Options& options, const dds_listener* listener);
  ~Entity();
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;

  std::int32_t handle() const { return handle_; }
  const ddsi_sertype& type() const { return *type_; }
  /// Writes a message (CDR). Returns false if it could not be written.
  bool write(std::string cdr) const;

 private:
  Participant& participant_;
  Participant::Kind kind_;
  std::int32_t topic_ = 0, handle_ = 0;
  ddsi_sertype* type_ = nullptr;
};

}  // namespace tileflight::ros2
