#include "tileflight/core/base/canonical_yaml.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::base {
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

/// As a quoted JSON string, so that no text can be mistaken for a list or a map.
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

}  // namespace

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

}  // namespace tileflight::base
