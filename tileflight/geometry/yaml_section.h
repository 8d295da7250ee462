#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/input_error.h"

namespace tileflight::geometry {

/// A map of a YAML file that is read key by key and knows which keys it was asked for: what is left over at finish() is
/// a mistake of whoever wrote the file, and named. Errors say file, line and key.
class YamlSection {
 public:
  /// `where` is the key that leads here ("" for the whole file).
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
  /// One of the words, or an error that lists them.
  std::optional<std::string> choice(const std::string& key, const std::vector<std::string>& words);
  std::optional<YamlSection> section(const std::string& key);
  /// A list of maps, each a section.
  std::vector<YamlSection> sections(const std::string& key);
  std::vector<std::string> keys() const;
  /// What a key's value says (yaml_meaning.h), to tell whether it changed.
  std::string meaning(const std::string& key) const;

  /// Throws for a key that nothing asked for, naming the nearest one that was.
  void finish() const;

  /// An error at a key of this section.
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

/// `${NAME}` replaced by the environment's value, `${NAME:-otherwise}` by what stands there when it has none. Throws
/// InputError when a variable without an alternative is not set, naming it.
std::string expand_variables(const std::string& text, const std::string& where);

}  // namespace tileflight::geometry
