#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::tile_content {

using Json = nlohmann::json;

/// Limits for an untrusted JSON text.
struct JsonLimits {
  std::size_t max_bytes = std::size_t{256} << 20;
  int max_depth = 512;  ///< nesting depth of arrays and objects
};

/// Returns what is wrong with a JSON text that the parser refused, and where: "line 171, column 3: …".
std::string describe_json_error(std::string_view text, const Json::parse_error& error);

/// Parses a JSON text; a byte order mark is skipped. Throws InputError (name, line, column, cause).
Json parse_json(std::string_view text, const std::string& name, const JsonLimits& limits = {});

/// Finds a member of an object; nullptr if it is absent. A null member counts as absent, because existing files contain
/// such members. The functions below do the same with a type; their `where` is the file and the path inside it for
/// messages, "tileset.json: root".
const Json* find_member(const Json& object, const char* key);
/// Finds a member that is an object; throws InputError if it has another type.
const Json* find_object(const Json& object, const char* key, const std::string& where);
/// Finds a member that is an array; throws InputError if it has another type.
const Json* find_array(const Json& object, const char* key, const std::string& where);

/// Finds a finite number; throws InputError if the member is something else.
std::optional<double> find_number(const Json& object, const char* key, const std::string& where);
/// Finds a text; throws InputError if the member is something else.
std::optional<std::string> find_string(const Json& object, const char* key, const std::string& where);
/// Finds a boolean; throws InputError if the member is something else.
std::optional<bool> find_bool(const Json& object, const char* key, const std::string& where);
/// Finds an integer from 0 to `max`; throws InputError if the member is something else.
std::optional<std::size_t> find_index(const Json& object, const char* key, const std::string& where,
                                      std::size_t max = std::size_t{1} << 53);
/// Finds exactly `count` finite numbers, or any number of them if `count` is 0. Throws InputError if the member is
/// something else.
std::optional<std::vector<double>> find_numbers(const Json& object, const char* key, std::size_t count,
                                                const std::string& where);
/// Finds a version, which some writers give as a number instead of a text: "1.0" for 1.0. Throws InputError if the
/// member is something else.
std::optional<std::string> find_version(const Json& object, const char* key, const std::string& where);
/// Returns the texts of an array; empty if the member is absent. Throws InputError if the member is something else.
std::vector<std::string> find_strings(const Json& object, const char* key, const std::string& where);

/// Returns the value; throws InputError, which names `key`, if it is missing.
template <class T>
T require_value(std::optional<T> value, const char* key, const std::string& where) {
  if (!value) throw InputError(where, std::string(key) + " is missing");
  return *std::move(value);
}

}  // namespace tileflight::tile_content
