#include "tileflight/core/base/strict_section.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::base {
namespace {

/// Such files are written by hand; anything larger is a mistake.
constexpr std::uintmax_t kLargestFileBytes = 16 << 20;

std::optional<std::size_t> count_of(const DocumentValue& value) {
  const std::optional<double> number = value.number();
  if (!number || *number < 0.0 || *number > 0x1p53 || *number != std::floor(*number)) return std::nullopt;
  return static_cast<std::size_t>(*number);
}

/// Converts each entry of a list; nullopt if the value is no list or an entry is of another type.
template <class T, class Convert>
std::optional<std::vector<T>> list_of(const DocumentValue& value, const Convert& convert) {
  if (!value.is_list()) return std::nullopt;
  std::vector<T> result;
  for (const DocumentValue& entry : value.entries()) {
    std::optional<T> converted = convert(entry);
    if (!converted) return std::nullopt;
    result.push_back(std::move(*converted));
  }
  return result;
}

/// Does the work of the public function. `seen`: positions of the maps and lists that were looked through, because
/// aliases repeat them.
void require_unique_keys(const YAML::Node& node, const std::filesystem::path& file, std::set<int>& seen) {
  if ((!node.IsMap() && !node.IsSequence()) || !seen.insert(node.Mark().pos).second) return;
  if (node.IsSequence()) {
    for (const YAML::Node& entry : node) require_unique_keys(entry, file, seen);
    return;
  }
  std::map<std::string, int> line_of;
  for (const auto& entry : node) {
    const YAML::Node& key = entry.first;
    const int line = key.Mark().line + 1;
    if (key.IsScalar()) {
      if (key.Scalar() == "<<")
        throw InputError(file.string() + ":" + std::to_string(line),
                         "'<<' (YAML's merge key) is not read: write out the keys that it stands for");
      const auto [first, is_new] = line_of.emplace(key.Scalar(), line);
      if (!is_new)
        throw InputError(file.string() + ":" + std::to_string(line),
                         "'" + first->first + "' is there twice, first in line " + std::to_string(first->second));
    }
    require_unique_keys(entry.second, file, seen);
  }
}

std::string number_text(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

}  // namespace

void require_unique_keys(const YAML::Node& node, const std::filesystem::path& file) {
  std::set<int> seen;
  require_unique_keys(node, file, seen);
}

StrictSection::StrictSection(DocumentValue value, std::filesystem::path file, std::string where)
    : value_(std::move(value)), file_(std::move(file)), where_(std::move(where)) {
  if (!value_.is_absent() && !value_.is_map()) {
    throw InputError(file_.string() + value_.line(),
                     (where_.empty() ? "the file" : "'" + where_ + "'") + " must be a map of keys");
  }
}

StrictSection::StrictSection(const nlohmann::json& json, std::filesystem::path file, std::string where,
                             std::vector<std::string>* warnings)
    : StrictSection(DocumentValue(&json), std::move(file), std::move(where)) {
  warnings_ = warnings;
}

StrictSection StrictSection::load(const std::filesystem::path& file) {
  const std::string text = read_text(file, kLargestFileBytes);
  try {
    const YAML::Node root = YAML::Load(text);
    require_unique_keys(root, file);
    if (root.IsMap()) return {DocumentValue(root), file, ""};
  } catch (const YAML::Exception& fault) {
    throw InputError(file.string() + ":" + std::to_string(fault.mark.line + 1), "not valid YAML: " + fault.msg);
  }
  throw InputError(file.string(), "the file must be a map of keys");
}

std::string StrictSection::dotted(const std::string& key) const { return where_.empty() ? key : where_ + "." + key; }

std::string StrictSection::place() const {
  return file_.string() + value_.line() + (where_.empty() ? "" : ": " + where_);
}

void StrictSection::warn(const std::string& key, const std::string& what) const {
  const InputError fault = error(key, what);
  if (warnings_ == nullptr) throw fault;
  warnings_->emplace_back(fault.what());
}

InputError StrictSection::error(const std::string& key, const std::string& what) const {
  const DocumentValue value = value_.member(key);
  return {file_.string() + (value.is_absent() ? value_.line() : value.line()), "'" + dotted(key) + "' " + what};
}

DocumentValue StrictSection::take(const std::string& key) {
  known_.push_back(key);
  return value_.member(key);
}

StrictSection StrictSection::part(DocumentValue value, const std::string& where) const {
  StrictSection result(std::move(value), file_, where);
  result.warnings_ = warnings_;
  return result;
}

bool StrictSection::has(const std::string& key) const { return !value_.member(key).is_absent(); }

bool StrictSection::is_map(const std::string& key) const { return value_.member(key).is_map(); }

bool StrictSection::is_list(const std::string& key) const { return value_.member(key).is_list(); }

std::optional<std::string> StrictSection::text(const std::string& key) {
  const DocumentValue value = take(key);
  if (value.is_null()) return std::nullopt;
  if (auto text = value.text(file_.string() + value.line())) return text;
  throw error(key, "must be text");
}

std::optional<double> StrictSection::number(const std::string& key) {
  const DocumentValue value = take(key);
  if (value.is_null()) return std::nullopt;
  if (const auto number = value.number()) return number;
  throw error(key, "must be a number");
}

std::optional<double> StrictSection::positive_number(const std::string& key) {
  const std::optional<double> value = number(key);
  if (value && *value <= 0.0) throw error(key, "must be more than 0");
  return value;
}

std::optional<int> StrictSection::integer(const std::string& key) {
  const DocumentValue value = take(key);
  if (value.is_null()) return std::nullopt;
  if (const auto integer = value.integer()) return integer;
  throw error(key, "must be a whole number");
}

std::optional<bool> StrictSection::boolean(const std::string& key) {
  const DocumentValue value = take(key);
  if (value.is_null()) return std::nullopt;
  if (const auto boolean = value.boolean()) return boolean;
  throw error(key, "must be true or false");
}

std::optional<std::vector<double>> StrictSection::numbers(const std::string& key, std::size_t at_least,
                                                          std::size_t at_most) {
  const DocumentValue value = take(key);
  if (value.is_null()) return std::nullopt;
  const std::string count =
      at_least == at_most ? std::to_string(at_least) : std::to_string(at_least) + " to " + std::to_string(at_most);
  if (!value.is_list()) throw error(key, "must be a list of " + count + " numbers");
  const auto result = list_of<double>(value, [](const DocumentValue& entry) { return entry.number(); });
  if (!result) throw error(key, "must be a list of numbers");
  if (result->size() < at_least || result->size() > at_most)
    throw error(key, "must be a list of " + count + " numbers");
  return result;
}

std::optional<std::filesystem::path> StrictSection::path(const std::string& key) {
  const std::optional<std::string> value = text(key);
  if (!value) return std::nullopt;
  return (file_.parent_path() / *value).lexically_normal();
}

std::optional<std::string> StrictSection::choice(const std::string& key, const std::vector<std::string>& words) {
  const std::optional<std::string> value = text(key);
  if (!value || std::find(words.begin(), words.end(), *value) != words.end()) return value;
  throw error(key, "is '" + *value + "'; it must be one of: " + joined(words));
}

std::optional<std::string> StrictSection::choice_in_any_case(const std::string& key,
                                                             const std::vector<std::string>& words) {
  const std::optional<std::string> value = text(key);
  if (!value) return value;
  for (const std::string& word : words) {
    if (to_lower(word) == to_lower(*value)) return word;
  }
  std::vector<std::string> shown = words;
  std::erase(shown, "");
  throw error(key, "is '" + *value + "'; it must be one of: " + joined(shown));
}

std::optional<StrictSection> StrictSection::section(const std::string& key) {
  const DocumentValue value = take(key);
  if (value.is_null() && !value.is_map()) return std::nullopt;
  return part(value, dotted(key));
}

std::vector<StrictSection> StrictSection::sections(const std::string& key) {
  const DocumentValue value = take(key);
  if (value.is_null()) return {};
  if (!value.is_list()) throw error(key, "must be a list");
  std::vector<StrictSection> result;
  for (const DocumentValue& entry : value.entries())
    result.push_back(part(entry, dotted(key) + "[" + std::to_string(result.size()) + "]"));
  return result;
}

std::vector<std::pair<std::string, StrictSection>> StrictSection::named_sections(const std::string& key) {
  std::vector<std::pair<std::string, StrictSection>> result;
  if (std::optional<StrictSection> map = section(key)) {
    for (const std::string& name : map->keys())
      result.emplace_back(name, map->part(map->take(name), map->dotted(name)));
  }
  return result;
}

double StrictSection::number(const std::string& key, double fallback, double min, double max) {
  const double value = number(key).value_or(fallback);
  if (has(key) && (value < min || value > max)) {
    throw error(key,
                "is " + number_text(value) + ", out of range: from " + number_text(min) + " to " + number_text(max));
  }
  return value;
}

int StrictSection::integer(const std::string& key, int fallback, int min, int max) {
  const double value = number(key, fallback, min, max);
  if (value != std::floor(value)) throw error(key, "must be a whole number");
  return static_cast<int>(value);
}

double StrictSection::clamped_number(const std::string& key, double fallback, double min, double max) {
  const double value = number(key).value_or(fallback);
  const double clamped = std::clamp(value, min, max);
  if (clamped == value || !has(key)) return value;
  if (warnings_ == nullptr || (value < 0.0 && min >= 0.0)) return number(key, fallback, min, max);
  warn(key, "is " + number_text(value) + ", out of range: from " + number_text(min) + " to " + number_text(max) +
                "; taken as " + number_text(clamped));
  return clamped;
}

int StrictSection::clamped_integer(const std::string& key, int fallback, int min, int max) {
  const double value = clamped_number(key, fallback, min, max);
  if (value != std::floor(value)) throw error(key, "must be a whole number");
  return static_cast<int>(value);
}

void StrictSection::require(const std::string& key) const {
  if (!has(key)) throw error(key, "is missing");
}

double StrictSection::required_number(const std::string& key) {
  require(key);
  return number(key).value_or(std::numeric_limits<double>::quiet_NaN());
}

std::size_t StrictSection::required_count(const std::string& key) {
  require(key);
  if (const auto count = count_of(take(key))) return *count;
  throw error(key, "must be a whole number, not negative");
}

std::string StrictSection::required_text(const std::string& key) {
  require(key);
  if (auto value = text(key)) return *value;
  throw error(key, "must be text");
}

std::vector<double> StrictSection::required_numbers(const std::string& key) {
  require(key);
  if (auto list = list_of<double>(take(key), [](const DocumentValue& entry) { return entry.number(); })) return *list;
  throw error(key, "must be a list of numbers");
}

std::vector<std::size_t> StrictSection::required_counts(const std::string& key) {
  require(key);
  if (auto list = list_of<std::size_t>(take(key), count_of)) return *list;
  throw error(key, "must be a list of whole numbers");
}

std::vector<std::string> StrictSection::required_texts(const std::string& key) {
  require(key);
  const auto text = [&](const DocumentValue& entry) { return entry.text(file_.string() + entry.line()); };
  if (auto list = list_of<std::string>(take(key), text)) return *list;
  throw error(key, "must be a list of texts");
}

StrictSection StrictSection::required_section(const std::string& key) {
  require(key);
  return part(take(key), dotted(key));
}

void StrictSection::ignore(const std::vector<std::string>& keys) {
  known_.insert(known_.end(), keys.begin(), keys.end());
}

void StrictSection::ignore_with_warning(const std::vector<std::string>& keys, const std::string& why) {
  for (const std::string& key : keys) {
    const DocumentValue value = take(key);
    const bool is_off = value.is_absent() || value.is_null() || value.boolean() == std::optional(false) ||
                        value.number() == std::optional(0.0) || (value.is_map() && value.keys().empty()) ||
                        (value.is_list() && value.entries().empty());
    if (!is_off) warn(key, "has no effect here: " + why);
  }
}

void StrictSection::require_all_keys_used() const {
  for (const std::string& key : keys()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    std::vector<std::string> known = known_;
    std::sort(known.begin(), known.end());
    known.erase(std::unique(known.begin(), known.end()), known.end());
    const std::string meant = did_you_mean(key, known_);
    // Another program's files have many keys, of which a list of all would only hide the one that is meant.
    const std::string others = warnings_ == nullptr ? "; there are " + joined(known) : "";
    const InputError fault = error(key, "is not a key here" + (meant.empty() ? others : meant));
    if (warnings_ == nullptr) throw fault;
    warnings_->push_back(std::string(fault.what()) + " (ignored)");
  }
}

}  // namespace tileflight::base
