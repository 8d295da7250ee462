#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/base/input_error.h"

namespace tileflight::base {

/// A map of a YAML file, read key by key. It records which keys were requested, so that unknown keys are reported as
/// mistakes of the file's author. Errors name file, line and key.
class YamlSection {
 public:
  /// `where`: key path of this section ("" for the whole file).
  YamlSection(YAML::Node node, std::filesystem::path file, std::string where);

  static YamlSection load(const std::filesystem::path& file);

  bool has(const std::string& key) const;
  std::optional<std::string> text(const std::string& key);
  /// A finite number.
  std::optional<double> number(const std::string& key);
  std::optional<int> integer(const std::string& key);
  std::optional<bool> boolean(const std::string& key);
  /// A list of `at_least` to `at_most` finite numbers.
  std::optional<std::vector<double>> numbers(const std::string& key, std::size_t at_least, std::size_t at_most);
  /// A path, relative to the file.
  std::optional<std::filesystem::path> path(const std::string& key);
  /// One of the words; otherwise an error that lists them.
  std::optional<std::string> choice(const std::string& key, const std::vector<std::string>& words);
  std::optional<YamlSection> section(const std::string& key);
  /// A list of maps, each a section.
  std::vector<YamlSection> sections(const std::string& key);
  std::vector<std::string> keys() const;
  /// Canonical text of a key's value (canonical_yaml.h), used to detect changes.
  std::string canonical_value(const std::string& key) const;

  /// Throws InputError for a key that was never requested, naming the most similar known one.
  void require_all_keys_used() const;

  /// An InputError that names file, line and a key of this section.
  InputError error(const std::string& key, const std::string& what) const;

  const std::filesystem::path& file() const { return file_; }

 private:
  YAML::Node take(const std::string& key);
  std::string dotted(const std::string& key) const;

  YAML::Node node_;
  std::filesystem::path file_;
  std::string where_;
  std::vector<std::string> known_;
};

/// Replaces `${NAME}` by the environment variable's value and `${NAME:-fallback}` by the fallback if the variable is
/// not set. Throws InputError, naming the variable, if one without a fallback is not set.
std::string expand_variables(const std::string& text, const std::string& where);

}  // namespace tileflight::base
