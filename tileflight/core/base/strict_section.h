#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

/// Throws InputError (file, line) for a key that a map of a YAML file has twice, which YAML forbids and yaml-cpp
/// accepts: one of the two would be ignored.
void require_unique_keys(const YAML::Node& node, const std::filesystem::path& file);

/// A map of a YAML or JSON file, read key by key. It records which keys were requested, so that unknown keys are
/// reported as mistakes of the file's author. Values of a wrong type and out of range throw InputError; errors name
/// file, line (of YAML) and key.
class StrictSection {
 public:
  /// `where`: key path of this section ("" for the whole file).
  StrictSection(DocumentValue value, std::filesystem::path file, std::string where);
  /// Wraps a JSON file, or the part of it at the key path `where`. `json` must outlive the section. `warnings`, if not
  /// null, receives messages about unknown keys here and in subsections, which are then no errors.
  StrictSection(const nlohmann::json& json, std::filesystem::path file, std::string where = "",
                std::vector<std::string>* warnings = nullptr);

  /// Reads a YAML file.
  static StrictSection load(const std::filesystem::path& file);

  /// Whether the key is there, with or without a value.
  bool has(const std::string& key) const;
  /// Whether the key's value is a map.
  bool is_map(const std::string& key) const;
  /// Whether the key's value is a list.
  bool is_list(const std::string& key) const;

  // Values of keys; nullopt if the key is absent or without a value.

  std::optional<std::string> text(const std::string& key);
  /// A finite number.
  std::optional<double> number(const std::string& key);
  std::optional<double> positive_number(const std::string& key);
  std::optional<int> integer(const std::string& key);
  std::optional<bool> boolean(const std::string& key);
  /// A list of `at_least` to `at_most` finite numbers.
  std::optional<std::vector<double>> numbers(const std::string& key, std::size_t at_least, std::size_t at_most);
  /// A path, relative to the file.
  std::optional<std::filesystem::path> path(const std::string& key);
  /// One of the words; otherwise an error that lists them.
  std::optional<std::string> choice(const std::string& key, const std::vector<std::string>& words);
  /// Reads one of the words without regard to case; returns it as spelled in `words`.
  std::optional<std::string> choice_in_any_case(const std::string& key, const std::vector<std::string>& words);
  /// A map; an empty one for a key without a value in YAML.
  std::optional<StrictSection> section(const std::string& key);
  /// A list of maps, each a section.
  std::vector<StrictSection> sections(const std::string& key);
  /// Name and section of each entry of a map of maps.
  std::vector<std::pair<std::string, StrictSection>> named_sections(const std::string& key);

  /// A number within `min` to `max`; `fallback` if the key is absent or without a value.
  double number(const std::string& key, double fallback, double min, double max);
  int integer(const std::string& key, int fallback, int min, int max);

  /// Returns what number() returns, but clamps a value beyond the range, with a warning, if the section was made with
  /// `warnings`: other programs' files may have such values. A negative one is refused where the range has none.
  double clamped_number(const std::string& key, double fallback, double min, double max);
  int clamped_integer(const std::string& key, int fallback, int min, int max);

  // Values of keys that must be there.

  /// NaN for a key without a value.
  double required_number(const std::string& key);
  /// A whole number, not negative.
  std::size_t required_count(const std::string& key);
  std::string required_text(const std::string& key);
  std::vector<double> required_numbers(const std::string& key);
  std::vector<std::size_t> required_counts(const std::string& key);
  std::vector<std::string> required_texts(const std::string& key);
  StrictSection required_section(const std::string& key);
  /// Throws InputError unless the key is there, with or without a value.
  void require(const std::string& key) const;

  std::vector<std::string> keys() const { return value_.keys(); }
  /// Returns the canonical_yaml() of a key's value, used to detect changes.
  std::string canonical_value(const std::string& key) const { return value_.member(key).canonical_text(); }

  /// Marks keys that have no effect here as known.
  void ignore(const std::vector<std::string>& keys);
  /// Marks keys as known that another program heeds, and warns (warn()) of each that is there with a value other than
  /// false, 0, null or nothing: it has no effect here. `why` ends the sentence, with what to do instead.
  void ignore_with_warning(const std::vector<std::string>& keys, const std::string& why);
  /// Throws InputError for a key that was never requested, naming the most similar known one; only warns if the section
  /// was made with `warnings`.
  void require_all_keys_used() const;

  /// Adds a warning that names file, line and a key of this section; throws it as InputError if the section was made
  /// without `warnings`.
  void warn(const std::string& key, const std::string& what) const;
  /// An InputError that names file, line and a key of this section.
  InputError error(const std::string& key, const std::string& what) const;
  /// Place of this section for messages: file, line and key path.
  std::string place() const;

  const std::filesystem::path& file() const { return file_; }

 private:
  DocumentValue take(const std::string& key);
  StrictSection part(DocumentValue value, const std::string& where) const;
  std::string dotted(const std::string& key) const;

  DocumentValue value_;
  std::filesystem::path file_;
  std::string where_;
  std::vector<std::string> known_;
  std::vector<std::string>* warnings_ = nullptr;
};

}  // namespace tileflight::base
