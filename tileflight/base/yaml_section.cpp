#include "tileflight/base/yaml_section.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "tileflight/base/canonical_yaml.h"
#include "tileflight/base/files.h"
#include "tileflight/base/known_keys.h"

namespace tileflight::base {
namespace {

/// Such files are written by hand; anything larger is a mistake.
constexpr std::uintmax_t kLargestFileBytes = 16 << 20;

std::string line_of(const YAML::Node& node) {
  const int line = node.Mark().line;
  return line < 0 ? "" : ":" + std::to_string(line + 1);
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

/// "camera, fps": the distinct words, joined.
std::string listed(std::vector<std::string> words) {
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

double finite_number(const YAML::Node& node) {
  const double value = node.as<double>();
  if (!std::isfinite(value)) throw YAML::BadConversion(node.Mark());
  return value;
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

YamlSection::YamlSection(YAML::Node node, std::filesystem::path file, std::string where)
    : node_(std::move(node)), file_(std::move(file)), where_(std::move(where)) {
  if (node_.IsDefined() && !node_.IsNull() && !node_.IsMap()) {
    throw InputError(file_.string() + line_of(node_),
                     (where_.empty() ? "the file" : "'" + where_ + "'") + " must be a map of keys");
  }
}

YamlSection YamlSection::load(const std::filesystem::path& file) {
  const std::string text = read_text(file, kLargestFileBytes);
  try {
    const YAML::Node root = YAML::Load(text);
    if (root.IsMap()) return {root, file, ""};
  } catch (const YAML::Exception& fault) {
    throw InputError(file.string() + ":" + std::to_string(fault.mark.line + 1), "not valid YAML: " + fault.msg);
  }
  throw InputError(file.string(), "the file must be a map of keys");
}

std::string YamlSection::dotted(const std::string& key) const { return where_.empty() ? key : where_ + "." + key; }

InputError YamlSection::error(const std::string& key, const std::string& what) const {
  const YAML::Node value = node_.IsMap() ? node_[key] : YAML::Node(YAML::NodeType::Undefined);
  return {file_.string() + (value.IsDefined() ? line_of(value) : line_of(node_)), "'" + dotted(key) + "' " + what};
}

YAML::Node YamlSection::take(const std::string& key) {
  known_.push_back(key);
  if (!node_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  const YAML::Node& map = node_;
  return map[key];
}

bool YamlSection::has(const std::string& key) const {
  const YAML::Node& map = node_;
  return map.IsMap() && map[key].IsDefined();
}

std::optional<std::string> YamlSection::text(const std::string& key) {
  const YAML::Node value = take(key);
  if (!value.IsDefined() || value.IsNull()) return std::nullopt;
  if (!value.IsScalar()) throw error(key, "must be text");
  return expand_variables(value.Scalar(), file_.string() + line_of(value));
}

std::optional<double> YamlSection::number(const std::string& key) {
  const YAML::Node value = take(key);
  if (!value.IsDefined() || value.IsNull()) return std::nullopt;
  try {
    return finite_number(value);
  } catch (const YAML::Exception&) {
    throw error(key, "must be a number");
  }
}

std::optional<int> YamlSection::integer(const std::string& key) {
  const YAML::Node value = take(key);
  if (!value.IsDefined() || value.IsNull()) return std::nullopt;
  try {
    return value.as<int>();
  } catch (const YAML::Exception&) {
    throw error(key, "must be a whole number");
  }
}

std::optional<bool> YamlSection::boolean(const std::string& key) {
  const YAML::Node value = take(key);
  if (!value.IsDefined() || value.IsNull()) return std::nullopt;
  try {
    return value.as<bool>();
  } catch (const YAML::Exception&) {
    throw error(key, "must be true or false");
  }
}

std::optional<std::vector<double>> YamlSection::numbers(const std::string& key, std::size_t at_least,
                                                        std::size_t at_most) {
  const YAML::Node value = take(key);
  if (!value.IsDefined() || value.IsNull()) return std::nullopt;
  std::vector<double> result;
  try {
    if (value.IsSequence()) {
      for (const YAML::Node& entry : value) result.push_back(finite_number(entry));
    }
  } catch (const YAML::Exception&) {
    throw error(key, "must be a list of numbers");
  }
  if (result.size() < at_least || result.size() > at_most) {
    const std::string count =
        at_least == at_most ? std::to_string(at_least) : std::to_string(at_least) + " to " + std::to_string(at_most);
    throw error(key, "must be a list of " + count + " numbers");
  }
  return result;
}

std::optional<std::filesystem::path> YamlSection::path(const std::string& key) {
  const std::optional<std::string> value = text(key);
  if (!value) return std::nullopt;
  return (file_.parent_path() / *value).lexically_normal();
}

std::optional<std::string> YamlSection::choice(const std::string& key, const std::vector<std::string>& words) {
  const std::optional<std::string> value = text(key);
  if (!value || std::find(words.begin(), words.end(), *value) != words.end()) return value;
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  throw error(key, "is '" + *value + "'; it must be one of: " + list);
}

std::optional<YamlSection> YamlSection::section(const std::string& key) {
  const YAML::Node value = take(key);
  if (!value.IsDefined()) return std::nullopt;
  return YamlSection(value, file_, dotted(key));
}

std::vector<YamlSection> YamlSection::sections(const std::string& key) {
  const YAML::Node value = take(key);
  if (!value.IsDefined() || value.IsNull()) return {};
  if (!value.IsSequence()) throw error(key, "must be a list");
  std::vector<YamlSection> result;
  for (const YAML::Node& entry : value) {
    result.emplace_back(entry, file_, dotted(key) + "[" + std::to_string(result.size()) + "]");
  }
  return result;
}

std::vector<std::string> YamlSection::keys() const {
  std::vector<std::string> result;
  if (node_.IsMap()) {
    for (const auto& entry : node_) result.push_back(entry.first.Scalar());
  }
  return result;
}

std::string YamlSection::canonical_value(const std::string& key) const {
  const YAML::Node& map = node_;
  return canonical_yaml(map[key]);
}

void YamlSection::require_all_keys_used() const {
  for (const std::string& key : keys()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    const std::string meant = did_you_mean(key, known_);
    throw error(key, "is not a key here" + (meant.empty() ? "; there are " + listed(known_) : meant));
  }
}

}  // namespace tileflight::base
