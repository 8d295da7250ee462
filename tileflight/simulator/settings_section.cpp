#include "tileflight/simulator/settings_section.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "tileflight/base/input_error.h"
#include "tileflight/base/known_keys.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using nlohmann::json;

std::string number_text(double value) {
  std::string text = json(value).dump();
  return text.ends_with(".0") ? text.substr(0, text.size() - 2) : text;
}

std::string join_words(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

}  // namespace

SettingsSection::SettingsSection(const json& object, std::string where, std::vector<std::string>& warnings)
    : json_(object), where_(std::move(where)), warnings_(warnings) {
  if (!object.is_object()) throw InputError(where_, "must be an object, {...}");
}

void SettingsSection::fail(const std::string& key, const std::string& what) const {
  throw InputError(where_ + (where_.find(": ") == std::string::npos ? ": " : ".") + key, what);
}

const json* SettingsSection::find(const char* key) {
  known_.insert(key);
  const auto at = json_.find(key);
  return at == json_.end() || at->is_null() ? nullptr : &*at;
}

double SettingsSection::number(const char* key, double otherwise, double least, double most) {
  const json* value = find(key);
  if (value == nullptr) return otherwise;
  if (!value->is_number()) fail(key, "must be a number");
  const double number = value->get<double>();
  if (!std::isfinite(number) || number < least || number > most)
    fail(key, number_text(number) + " is out of range: from " + number_text(least) + " to " + number_text(most));
  return number;
}

int SettingsSection::integer(const char* key, int otherwise, int least, int most) {
  const double value = number(key, otherwise, least, most);
  if (value != std::floor(value)) fail(key, "must be a whole number");
  return static_cast<int>(value);
}

bool SettingsSection::boolean(const char* key, bool otherwise) {
  const json* value = find(key);
  if (value == nullptr) return otherwise;
  if (!value->is_boolean()) fail(key, "must be true or false");
  return value->get<bool>();
}

std::string SettingsSection::text(const char* key, const std::string& otherwise) {
  const json* value = find(key);
  if (value == nullptr) return otherwise;
  if (!value->is_string()) fail(key, "must be a text in quotes");
  return value->get<std::string>();
}

std::string SettingsSection::choice(const char* key, const std::string& otherwise,
                                    const std::vector<std::string>& words) {
  const std::string value = text(key, otherwise);
  for (const std::string& word : words) {
    if (base::to_lower(word) == base::to_lower(value)) return word;
  }
  fail(key, "'" + value + "' is not known here: " + join_words(words));
}

std::vector<double> SettingsSection::numbers(const char* key, std::size_t most) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_array() || value->size() > most)
    fail(key, "must be a list of at most " + std::to_string(most) + " numbers");
  std::vector<double> numbers;
  for (const json& entry : *value) {
    if (!entry.is_number() || !std::isfinite(entry.get<double>())) fail(key, "must be a list of numbers");
    numbers.push_back(entry.get<double>());
  }
  return numbers;
}

std::optional<SettingsSection> SettingsSection::section(const char* key) {
  const json* value = find(key);
  if (value == nullptr) return std::nullopt;
  const std::string separator = where_.find(": ") == std::string::npos ? ": " : ".";
  return SettingsSection(*value, where_ + separator + key, warnings_);
}

std::vector<SettingsSection> SettingsSection::list(const char* key) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_array()) fail(key, "must be a list, [...]");
  std::vector<SettingsSection> sections;
  const std::string separator = where_.find(": ") == std::string::npos ? ": " : ".";
  for (std::size_t i = 0; i < value->size(); ++i)
    sections.emplace_back((*value)[i], where_ + separator + key + "[" + std::to_string(i) + "]", warnings_);
  return sections;
}

std::vector<std::pair<std::string, SettingsSection>> SettingsSection::members(const char* key) {
  const json* value = find(key);
  if (value == nullptr) return {};
  if (!value->is_object()) fail(key, "must be an object, {...}");
  std::vector<std::pair<std::string, SettingsSection>> members;
  const std::string separator = where_.find(": ") == std::string::npos ? ": " : ".";
  for (const auto& [name, member] : value->items())
    members.emplace_back(name, SettingsSection(member, where_ + separator + key + "." + name, warnings_));
  return members;
}

geometry::Vec3 SettingsSection::position(const geometry::Vec3& otherwise) {
  constexpr double kFar_m = 1e7;
  const auto along = [&](const char* key, double value) { return number(key, value, -kFar_m, kFar_m); };
  const double x = along("X", otherwise.x()), y = along("Y", otherwise.y());
  return {x, y, along("Z", otherwise.z())};
}

Eigen::Quaterniond SettingsSection::orientation(const geometry::Vec3& otherwise_deg) {
  const auto angle = [&](const char* key, double value) { return radians(number(key, value, -3600.0, 3600.0)); };
  const double roll = angle("Roll", otherwise_deg.x()), pitch = angle("Pitch", otherwise_deg.y());
  return rotation_from_rpy(roll, pitch, angle("Yaw", otherwise_deg.z()));
}

void SettingsSection::mark_ignored(const std::vector<std::string>& keys) {
  for (const std::string& key : keys) known_.insert(key);
}

void SettingsSection::warn_unknown_keys() {
  const std::vector<std::string> known(known_.begin(), known_.end());
  for (const auto& [key, value] : json_.items()) {
    if (known_.contains(key)) continue;
    warnings_.push_back(where_ + ": the key '" + key + "' is not known and not heeded; nearest: '" +
                        base::nearest_key(key, known) + "'");
  }
}

}  // namespace tileflight::simulator
