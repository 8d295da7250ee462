#pragma once

#include <yaml-cpp/yaml.h>

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace tileflight::base {

/// Returns the least number of single-character insertions, deletions and substitutions that turn `a` into `b`
/// (Levenshtein 1966).
std::size_t edit_distance(std::string_view a, std::string_view b);

/// Returns the known key closest to `unknown` in spelling (smallest edit distance, first on ties), for messages such as
/// "unknown key 'fsp', did you mean 'fps'?". Empty if there are no known keys.
std::string nearest_key(std::string_view unknown, const std::vector<std::string>& known);

/// Returns the end of a message, "; did you mean 'fps'?", if a known key is spelled similarly (at most half of the
/// letters differ); otherwise an empty text.
std::string did_you_mean(std::string_view unknown, const std::vector<std::string>& known);

/// Returns a canonical one-line text of a YAML node: equivalent nodes give the same text. Comments, key order, quotes,
/// block or flow style and number notation make no difference; `${NAME}` is replaced where the variable is set. Throws
/// InputError for nodes nested deeper than settings files are.
std::string canonical_yaml(const YAML::Node& node);

/// Parses a text and returns its canonical_yaml(). Returns the text unchanged if it is not a YAML map, as that of
/// another calibration format.
std::string canonical_yaml_text(const std::string& text);

/// A value of a YAML or JSON file: a scalar, a list or a map. The accessors of scalars return nullopt if the value is
/// of another type.
class DocumentValue {
 public:
  explicit DocumentValue(YAML::Node node) : value_(std::move(node)) {}
  /// Wraps a JSON value, which must outlive this object. A null pointer stands for an absent value.
  explicit DocumentValue(const nlohmann::json* json) : value_(json) {}

  bool is_absent() const;
  /// Whether the value is absent or empty (`key:` in YAML, null in JSON).
  bool is_null() const;
  /// Whether the value is a map. A YAML key without a value counts as an empty map, which leaves all defaults.
  bool is_map() const;
  bool is_list() const;
  /// Returns the line in the file as ":12"; empty for JSON, whose parser does not keep it.
  std::string line() const;

  /// Returns the number if it is finite.
  std::optional<double> number() const;
  std::optional<int> integer() const;
  std::optional<bool> boolean() const;
  /// Returns the text of a scalar, in YAML with its variables expanded (expand_variables()). `where` is the place for
  /// errors.
  std::optional<std::string> text(const std::string& where) const;

  /// Returns the entries of a list; empty for other values.
  std::vector<DocumentValue> entries() const;
  /// Returns the keys of a map; none for other values.
  std::vector<std::string> keys() const;
  /// Returns the value of a map's key; an absent value if there is none.
  DocumentValue member(const std::string& key) const;

  /// Returns the canonical_yaml() of a YAML value.
  std::string canonical_text() const;

 private:
  std::variant<YAML::Node, const nlohmann::json*> value_;
};

/// Replaces `${NAME}` by the environment variable's value and `${NAME:-fallback}` by the fallback if the variable is
/// not set. Throws InputError, naming the variable, if one without a fallback is not set.
std::string expand_variables(const std::string& text, const std::string& where);

}  // namespace tileflight::base
