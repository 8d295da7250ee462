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

/// Parses a JSON text; a byte order mark is skipped. Throws InputError (name, cause, byte).
Json parse_json(std::string_view text, const std::string& name, const JsonLimits& limits = {});

/// Typed access with error locations: `where` is the file and the path inside it, "tileset.json: root". A null member
/// counts as absent, as in existing files.
const Json* find_member(const Json& object, const char* key);
/// As find_member, but throws InputError if the member is not an object or not an array, respectively.
const Json* find_object(const Json& object, const char* key, const std::string& where);
const Json* find_array(const Json& object, const char* key, const std::string& where);

/// A finite number.
std::optional<double> find_number(const Json& object, const char* key, const std::string& where);
std::optional<std::string> find_string(const Json& object, const char* key, const std::string& where);
std::optional<bool> find_bool(const Json& object, const char* key, const std::string& where);
/// An integer from 0 to `max`.
std::optional<std::size_t> find_index(const Json& object, const char* key, const std::string& where,
                                      std::size_t max = std::size_t{1} << 53);
/// Exactly `count` finite numbers (any number of them if `count` is 0).
std::optional<std::vector<double>> find_numbers(const Json& object, const char* key, std::size_t count,
                                                const std::string& where);
/// Empty if the member is absent.
std::vector<std::string> find_strings(const Json& object, const char* key, const std::string& where);

/// The value; throws InputError if it is missing, naming `key`.
template <class T>
T require_value(std::optional<T> value, const char* key, const std::string& where) {
  if (!value) throw InputError(where, std::string(key) + " is missing");
  return *std::move(value);
}

}  // namespace tileflight::tile_content
