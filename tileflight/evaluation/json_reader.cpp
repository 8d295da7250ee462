#include "tileflight/evaluation/json_reader.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>

#include "tileflight/base/input_error.h"
#include "tileflight/base/known_keys.h"

namespace tileflight::evaluation {

using nlohmann::json;

JsonReader::JsonReader(const json& object, std::string where, std::string path)
    : object_(&object), where_(std::move(where)), path_(std::move(path)) {
  if (!object.is_object())
    throw InputError(where_, path_.empty() ? "must be a JSON object" : "key '" + path_ + "' must be an object");
}

std::string JsonReader::name(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

void JsonReader::fail(const std::string& key, const std::string& cause) const {
  throw InputError(where_, "key '" + name(key) + "' " + cause);
}

const json& JsonReader::value(const std::string& key) {
  asked_.push_back(key);
  const auto found = object_->find(key);
  if (found == object_->end()) fail(key, "is missing");
  return *found;
}

double JsonReader::number(const std::string& key) {
  const json& v = value(key);
  if (v.is_null()) return std::numeric_limits<double>::quiet_NaN();
  if (!v.is_number()) fail(key, "must be a number");
  return v.get<double>();
}

std::size_t JsonReader::count(const std::string& key) {
  const json& v = value(key);
  if (!v.is_number_unsigned()) fail(key, "must be a whole number, not negative");
  return v.get<std::size_t>();
}

std::string JsonReader::text(const std::string& key) {
  const json& v = value(key);
  if (!v.is_string()) fail(key, "must be text");
  return v.get<std::string>();
}

std::vector<double> JsonReader::numbers(const std::string& key) {
  const json& list = value(key);
  const auto is_number = [](const json& v) { return v.is_number(); };
  if (!list.is_array() || !std::all_of(list.begin(), list.end(), is_number)) fail(key, "must be a list of numbers");
  return list.get<std::vector<double>>();
}

std::vector<std::size_t> JsonReader::counts(const std::string& key) {
  const json& list = value(key);
  const auto is_count = [](const json& v) { return v.is_number_unsigned(); };
  if (!list.is_array() || !std::all_of(list.begin(), list.end(), is_count))
    fail(key, "must be a list of whole numbers");
  return list.get<std::vector<std::size_t>>();
}

std::vector<std::string> JsonReader::texts(const std::string& key) {
  const json& list = value(key);
  const auto is_text = [](const json& v) { return v.is_string(); };
  if (!list.is_array() || !std::all_of(list.begin(), list.end(), is_text)) fail(key, "must be a list of texts");
  return list.get<std::vector<std::string>>();
}

bool JsonReader::has(const std::string& key) {
  asked_.push_back(key);
  return object_->contains(key);
}

JsonReader JsonReader::object(const std::string& key) { return {value(key), where_, name(key)}; }

std::vector<std::string> JsonReader::keys() const {
  std::vector<std::string> result;
  for (const auto& item : object_->items()) result.push_back(item.key());
  return result;
}

void JsonReader::expect_all_read() const {
  for (const std::string& key : keys()) {
    if (std::find(asked_.begin(), asked_.end(), key) != asked_.end()) continue;
    fail(key, "is unknown, did you mean '" + base::nearest_key(key, asked_) + "'?");
  }
}

}  // namespace tileflight::evaluation
