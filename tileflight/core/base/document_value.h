#pragma once

#include <yaml-cpp/yaml.h>

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace tileflight::base {

/// Least number of single-character insertions, deletions and substitutions that turn `a` into `b` (Levenshtein 1966).
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The known key closest to `unknown` in spelling (smallest edit distance, first on ties), for messages such as
/// "unknown key 'fsp', did you mean 'fps'?". Empty if there are no known keys.
std::string nearest_key(std::string_view unknown, const std::vector<std::string>& known);

/// "; did you mean 'fps'?" to end a message, if a known key is spelled similarly (at most half of the letters differ);
/// otherwise empty.
std::string did_you_mean(std::string_view unknown, const std::vector<std::string>& known);

/// Canonical one-line text of a YAML node: equivalent nodes give the same text. Comments, key order, quotes, block or
/// flow style and number notation make no difference; `${NAME}` is replaced where the variable is set. Throws
/// InputError for nodes nested deeper than settings files are.
std::string canonical_yaml(const YAML::Node& node);

/// canonical_yaml() of a parsed text; the text unchanged if it is not a YAML map (another calibration format, for
/// example).
std::string canonical_yaml_text(const std::string& text);

/// A value of a YAML or JSON file: a scalar, a list or a map. The accessors of scalars return nullopt if the value is
/// of another type.
class DocumentValue {
 public:
  explicit DocumentValue(YAML::Node node) : value_(std::move(node)) {}
  /// `json` must outlive it; null: the value is absent.
  explicit DocumentValue(const nlohmann::json* json) : value_(json) {}

  bool is_absent() const;
  /// Absent, or without a value (`key:` in YAML, null in JSON).
  bool is_null() const;
  /// Also of a key without a value in YAML: the map of no keys, which leaves everything at its default.
  bool is_map() const;
  bool is_list() const;
  /// ":12", the line in the file; empty for JSON, which does not keep it.
  std::string line() const;

  /// A finite number.
  std::optional<double> number() const;
  std::optional<int> integer() const;
  std::optional<bool> boolean() const;
  /// Text of a scalar; in YAML with its variables expanded (expand_variables; `where`: place for errors).
  std::optional<std::string> text(const std::string& where) const;

  /// Entries of a list; empty for other values.
  std::vector<DocumentValue> entries() const;
  /// Keys of a map; none for other values.
  std::vector<std::string> keys() const;
  /// The value of a map's key; absent if there is none.
  DocumentValue member(const std::string& key) const;

  /// Canonical text (document_value.h) of a YAML value.
  std::string canonical_text() const;

 private:
  std::variant<YAML::Node, const nlohmann::json*> value_;
};

/// Replaces `${NAME}` by the environment variable's value and `${NAME:-fallback}` by the fallback if the variable is
/// not set. Throws InputError, naming the variable, if one without a fallback is not set.
std::string expand_variables(const std::string& text, const std::string& where);

}  // namespace tileflight::base
