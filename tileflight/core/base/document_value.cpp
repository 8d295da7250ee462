#include "tileflight/core/base/document_value.h"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/canonical_yaml.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::base {
namespace {

using nlohmann::json;

/// Expands `NAME` or `NAME:-fallback`, as in a shell.
std::string value_of_variable(const std::string& expression, const std::string& where) {
  const std::size_t mark = expression.find(":-");
  const std::string name = expression.substr(0, mark);
  const char* value = std::getenv(name.c_str());
  if (value != nullptr && *value != '\0') return value;
  if (mark != std::string::npos) return expression.substr(mark + 2);
  throw InputError(where, "the environment variable " + name + " is not set; set it and run again");
}

template <class T>
std::optional<T> scalar(const YAML::Node& node) {
  T value{};
  return node.IsDefined() && YAML::convert<T>::decode(node, value) ? std::optional(value) : std::nullopt;
}

}  // namespace

std::string expand_variables(const std::string& text, const std::string& where) {
  std::string result;
  std::size_t at = 0;
  while (true) {
    const std::size_t open = text.find("${", at);
    if (open == std::string::npos) return result + text.substr(at);
    const std::size_t close = text.find('}', open);
    if (close == std::string::npos) throw InputError(where, "'${' without '}' in \"" + text + "\"");
    result += text.substr(at, open - at) + value_of_variable(text.substr(open + 2, close - open - 2), where);
    at = close + 1;
  }
}

bool DocumentValue::is_absent() const {
  const YAML::Node* node = std::get_if<YAML::Node>(&value_);
  return node != nullptr ? !node->IsDefined() : std::get<const json*>(value_) == nullptr;
}

bool DocumentValue::is_null() const {
  if (is_absent()) return true;
  const YAML::Node* node = std::get_if<YAML::Node>(&value_);
  return node != nullptr ? node->IsNull() : std::get<const json*>(value_)->is_null();
}

bool DocumentValue::is_map() const {
  if (is_absent()) return false;
  const YAML::Node* node = std::get_if<YAML::Node>(&value_);
  return node != nullptr ? node->IsMap() || node->IsNull() : std::get<const json*>(value_)->is_object();
}

bool DocumentValue::is_list() const {
  if (is_absent()) return false;
  const YAML::Node* node = std::get_if<YAML::Node>(&value_);
  return node != nullptr ? node->IsSequence() : std::get<const json*>(value_)->is_array();
}

std::string DocumentValue::line() const {
  const YAML::Node* node = std::get_if<YAML::Node>(&value_);
  const int line = node != nullptr ? node->Mark().line : -1;
  return line < 0 ? "" : ":" + std::to_string(line + 1);
}

std::optional<double> DocumentValue::number() const {
  std::optional<double> value;
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_)) {
    value = scalar<double>(*node);
  } else if (const json* j = std::get<const json*>(value_); j != nullptr && j->is_number()) {
    value = j->get<double>();
  }
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<int> DocumentValue::integer() const {
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_)) return scalar<int>(*node);
  const std::optional<double> value = number();
  if (!value || *value != std::floor(*value) || std::abs(*value) > std::numeric_limits<int>::max()) return std::nullopt;
  return static_cast<int>(*value);
}

std::optional<bool> DocumentValue::boolean() const {
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_)) return scalar<bool>(*node);
  const json* j = std::get<const json*>(value_);
  return j != nullptr && j->is_boolean() ? std::optional(j->get<bool>()) : std::nullopt;
}

std::optional<std::string> DocumentValue::text(const std::string& where) const {
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_)) {
    if (!node->IsDefined() || !node->IsScalar()) return std::nullopt;
    return expand_variables(node->Scalar(), where);
  }
  const json* j = std::get<const json*>(value_);
  return j != nullptr && j->is_string() ? std::optional(j->get<std::string>()) : std::nullopt;
}

std::vector<DocumentValue> DocumentValue::entries() const {
  std::vector<DocumentValue> result;
  if (!is_list()) return result;
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_)) {
    for (const YAML::Node& entry : *node) result.emplace_back(entry);
  } else {
    for (const json& entry : *std::get<const json*>(value_)) result.emplace_back(&entry);
  }
  return result;
}

std::vector<std::string> DocumentValue::keys() const {
  std::vector<std::string> result;
  if (!is_map()) return result;
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_)) {
    for (const auto& entry : *node) result.push_back(entry.first.Scalar());
  } else {
    for (const auto& entry : std::get<const json*>(value_)->items()) result.push_back(entry.key());
  }
  return result;
}

DocumentValue DocumentValue::member(const std::string& key) const {
  if (const YAML::Node* node = std::get_if<YAML::Node>(&value_))
    return DocumentValue(node->IsMap() ? (*node)[key] : YAML::Node(YAML::NodeType::Undefined));
  const json* none = nullptr;
  if (!is_map()) return DocumentValue(none);
  const json& map = *std::get<const json*>(value_);
  const auto found = map.find(key);
  return DocumentValue(found == map.end() ? none : &*found);
}

std::string DocumentValue::canonical_text() const { return canonical_yaml(std::get<YAML::Node>(value_)); }

}  // namespace tileflight::base
