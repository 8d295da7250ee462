#include "tileflight/core/base/document_value.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::base {
using nlohmann::json;

namespace {

constexpr int kDeepest = 64;              // limit of nesting: an alias can refer to its own ancestor
constexpr std::size_t kExactDigits = 15;  // decimal digits that a double always preserves

std::string filled_in(const std::string& scalar) {
  try {
    return expand_variables(scalar, "");
  } catch (const InputError&) {
    return scalar;  // left unchanged: the reader of the value reports the error
  }
}

/// Quotes a text as a JSON string, so that no text can be mistaken for a list or a map.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c == '\n' ? std::string("\\n") : std::string(1, c);
  }
  return result + "\"";
}

std::string scalar_text(const std::string& text) {
  const auto digits =
      static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; }));
  const auto number = digits > 0 && digits <= kExactDigits ? parse_number<double>(text) : std::nullopt;
  if (!number || !std::isfinite(*number)) return quoted(text);
  std::string result;
  append_number(result, *number == 0.0 ? 0.0 : *number);
  return result;
}

std::string meaning(const YAML::Node& node, int depth) {
  if (depth > kDeepest) throw InputError("YAML", "lists and maps are nested too deeply");
  if (!node.IsDefined() || node.IsNull()) return "null";
  if (node.IsScalar()) return scalar_text(filled_in(node.Scalar()));
  std::string text;
  if (node.IsSequence()) {
    for (const YAML::Node& entry : node) text += (text.empty() ? "" : ",") + meaning(entry, depth + 1);
    return "[" + text + "]";
  }
  std::vector<std::string> entries;
  for (const auto& entry : node)
    entries.push_back(meaning(entry.first, depth + 1) + ":" + meaning(entry.second, depth + 1));
  std::sort(entries.begin(), entries.end());
  for (const std::string& entry : entries) text += (text.empty() ? "" : ",") + entry;
  return "{" + text + "}";
}

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

std::size_t edit_distance(std::string_view a, std::string_view b) {
  // Wagner and Fischer (Journal of the ACM 21(1), 1974), one row at a time: row[j] = distance(a[0..i), b[0..j)).
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

std::string nearest_key(std::string_view unknown, const std::vector<std::string>& known) {
  const auto nearest = std::min_element(known.begin(), known.end(), [&](const std::string& a, const std::string& b) {
    return edit_distance(unknown, a) < edit_distance(unknown, b);
  });
  return nearest == known.end() ? std::string() : *nearest;
}

std::string did_you_mean(std::string_view unknown, const std::vector<std::string>& known) {
  const std::string nearest = nearest_key(unknown, known);
  const std::size_t longer = std::max(unknown.size(), nearest.size());
  const bool is_beginning = unknown.size() >= 3 && nearest.starts_with(unknown);
  // Allows two of five letters to differ, plus one transposition in short words.
  if (nearest.empty() || (!is_beginning && 5 * edit_distance(unknown, nearest) > 2 * longer + 2)) return "";
  return "; did you mean '" + nearest + "'?";
}

std::string canonical_yaml(const YAML::Node& node) { return meaning(node, 0); }

std::string canonical_yaml_text(const std::string& text) {
  try {
    const YAML::Node root = YAML::Load(text);
    if (root.IsMap()) return canonical_yaml(root);
  } catch (const YAML::Exception&) {
    return text;
  }
  return text;
}

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
