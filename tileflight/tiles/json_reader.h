#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/geometry/input_error.h"

namespace tileflight::tiles {

using Json = nlohmann::json;

/// What a JSON text of unknown origin may be.
struct JsonLimits {
  std::size_t max_bytes = std::size_t{256} << 20;
  int max_depth = 512;  ///< arrays and objects inside each other
};

/// A JSON text; a byte order mark is passed over. Throws InputError (name, cause, byte).
Json parse_json(std::string_view text, const std::string& name, const JsonLimits& limits = {});

/// Typed access that names the place of a fault: `where` is the file and the path inside it, "tileset.json: root". A
/// member that is null counts as absent, as real files mean it.
const Json* find_member(const Json& object, const char* key);
/// As find_member, but throws where the member is not an object or an array.
const Json* find_object(const Json& object, const char* key, const std::string& where);
const Json* find_array(const Json& object, const char* key, const std::string& where);

/// Finite number.
std::optional<double> find_number(const Json& object, const char* key, const std::string& where);
std::optional<std::string> find_string(const Json& object, const char* key, const std::string& where);
std::optional<bool> find_bool(const Json& object, const char* key, const std::string& where);
/// Integer from 0 up to `max`.
std::optional<std::size_t> find_index(const Json& object, const char* key, const std::string& where,
                                      std::size_t max = std::size_t{1} << 53);
/// Exactly `count` finite numbers (any number of them where `count` is 0).
std::optional<std::vector<double>> find_numbers(const Json& object, const char* key, std::size_t count,
                                                const std::string& where);
/// Empty where the member is absent.
std::vector<std::string> find_strings(const Json& object, const char* key, const std::string& where);

/// The value or an InputError that says that `key` is missing.
template <class T>
T required(std::optional<T> value, const char* key, const std::string& where) {
  if (!value) throw InputError(where, std::string(key) + " is missing");
  return *std::move(value);
}

}  // namespace tileflight::tiles
