#include "tileflight/live/ros2/entities.h"

#include <dds/dds.h>

#include <memory>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/ros2/raw_type.h"

namespace tileflight::ros2 {
namespace {

/// "a/b/C" → "a::b::dds_::C" + ending
std::string dds_name(std::string_view type, std::string_view ending) {
  std::string name;
  std::size_t begin = 0;
  for (std::size_t slash = type.find('/'); slash != std::string_view::npos; slash = type.find('/', begin)) {
    name.append(type.substr(begin, slash - begin)).append("::");
    begin = slash + 1;
  }
  return name.append("dds_::").append(type.substr(begin)).append(ending);
}

bool is_letter_or_digit(char c) { return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

}  // namespace

std::string dds_topic(std::string_view topic) { return std::string("rt").append(topic); }

std::string dds_request_topic(std::string_view service) { return std::string("rq").append(service).append("Request"); }

std::string dds_reply_topic(std::string_view service) { return std::string("rr").append(service).append("Reply"); }

std::string dds_type(std::string_view type) { return dds_name(type, "_"); }

std::string dds_request_type(std::string_view service_type) { return dds_name(service_type, "_Request_"); }

std::string dds_response_type(std::string_view service_type) { return dds_name(service_type, "_Response_"); }

std::string valid_name(std::string_view name) {
  std::string valid;
  for (const char c : name) {
    const bool is_first = valid.empty() || valid.back() == '/';
    if (c == '/' && is_first && !valid.empty()) continue;
    if (is_first && c >= '0' && c <= '9') valid += "id_";
    valid += c == '/' || is_letter_or_digit(c) ? c : '_';
  }
  return valid;
}

namespace {

using Qos = std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)>;

/// Translates a quality of service as rmw_cyclonedds_cpp does. Writers never wait for room, since the history has a
/// depth (configuration()).
Qos make_qos(const QualityOfService& quality, const std::string& user_data) {
  Qos qos(dds_create_qos(), dds_delete_qos);
  const auto depth = static_cast<std::int32_t>(quality.depth);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_reliability(qos.get(), quality.is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_durability(qos.get(), quality.is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  if (quality.is_latched)
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  if (!user_data.empty()) dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  return qos;
}

std::int32_t checked(std::int32_t entity, const std::string& topic) {
  if (entity < 0) throw InputError(topic, std::string("cannot be opened in DDS: ") + dds_strretcode(-entity));
  return entity;
}

}  // namespace

Entity::Entity(Participant& participant, Participant::Kind kind, const Options& options, const dds_listener* listener)
    : participant_(participant), kind_(kind), type_(make_raw_type(options.type, options.max_bytes)) {
  const Qos qos = make_qos(options.quality, options.user_data);
  topic_ =
      checked(dds_create_topic_sertype(participant.handle(), options.topic.c_str(), &type_, nullptr, nullptr, nullptr),
              options.topic);
  handle_ = kind == Participant::Kind::kWriter ? dds_create_writer(participant.handle(), topic_, qos.get(), listener)
                                               : dds_create_reader(participant.handle(), topic_, qos.get(), listener);
  if (handle_ < 0) {
    dds_delete(topic_);
    checked(handle_, options.topic);
  }
  participant_.add(kind_, handle_);
}

Entity::~Entity() {
  participant_.remove(kind_, handle_);
  dds_delete(handle_);
  dds_delete(topic_);
}

bool Entity::write(std::string cdr) const {
  return dds_writecdr(handle_, make_raw_message(*type_, std::move(cdr))) == DDS_RETCODE_OK;
}

}  // namespace tileflight::ros2
