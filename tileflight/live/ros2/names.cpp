#include "tileflight/live/ros2/names.h"

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

}  // namespace tileflight::ros2
