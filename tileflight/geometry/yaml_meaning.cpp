#include "tileflight/geometry/yaml_meaning.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/text_fields.h"
#include "tileflight/geometry/yaml_section.h"

namespace tileflight::geometry {
namespace {

constexpr int kDeepest = 64;              // an alias can lead back to where it stands
constexpr std::size_t kExactDigits = 15;  // of a number that a double tells from its neighbours

std::string filled_in(const std::string& scalar) {
  try {
    return expand_variables(scalar, "");
  } catch (const InputError&) {
    return scalar;  // whoever needs the value says what is wrong with it
  }
}

/// In quotes, as a JSON string: no text looks like a list or a map.
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
  if (depth > kDeepest) throw InputError("YAML", "lists and maps lie too deep in each other");
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

}  // namespace

std::string meaning_of(const YAML::Node& node) { return meaning(node, 0); }

std::string meaning_of_text(const std::string& text) {
  try {
    const YAML::Node root = YAML::Load(text);
    if (root.IsMap()) return meaning_of(root);
  } catch (const YAML::Exception&) {
    return text;
  }
  return text;
}

}  // namespace tileflight::geometry
