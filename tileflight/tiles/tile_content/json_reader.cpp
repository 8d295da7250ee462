#include "tileflight/tiles/tile_content/json_reader.h"

#include <algorithm>
#include <cctype>
#include <cmath>

namespace tileflight::tile_content {
namespace {

/// Maximum bracket depth outside of strings; may be wrong for malformed text, which the parser then rejects.
int bracket_depth(std::string_view text) {
  int depth = 0;
  int deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      deepest = std::max(deepest, ++depth);
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return deepest;
}

/// Says what is wrong at a byte that the parser refused, by what stands there and by the parser's own words.
std::string cause_of(std::string_view text, std::size_t at, std::string_view parser_words) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF") ||
      (text.size() > 1 && (text[0] == '\0' || text[1] == '\0'))) {
    return "the text is UTF-16; save it as UTF-8";
  }
  // The parser stops within a wrong word or behind it.
  const auto is_word = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '-'; };
  std::size_t begin = std::min(at, text.size());
  while (begin > 0 && is_word(text[begin - 1])) --begin;
  std::size_t end = begin;
  while (end < text.size() && end < begin + 16 && is_word(text[end])) ++end;
  const std::string_view word = text.substr(begin, end - begin);
  for (const std::string_view number : {"NaN", "nan", "-nan", "-NaN", "Infinity", "-Infinity", "inf", "-inf", "Inf"}) {
    if (word == number) return std::string(number) + " is not a number in JSON; write a finite number";
  }
  if (at >= text.size() || parser_words.find("unexpected end of input") != std::string_view::npos) {
    return "the text ends early; it is cut off, or a bracket or a quotation mark is missing";
  }
  // "…syntax error while parsing object - unexpected ']'; expected '}'"; "last read" would quote the file's bytes.
  const std::size_t unexpected = parser_words.rfind("unexpected ");
  if (unexpected != std::string_view::npos && parser_words.find("last read") == std::string_view::npos)
    return std::string(parser_words.substr(unexpected));
  if (parser_words.find("invalid string") != std::string_view::npos) {
    return "a text is not closed, or contains a control character, a wrong escape or bytes that are not UTF-8";
  }
  return "a word or a number is malformed, or a quotation mark or a comma is missing";
}

[[noreturn]] void throw_type(const char* key, const std::string& where, const std::string& expected,
                             const Json& found) {
  throw InputError(where, std::string(key) + " is " + std::string(found.type_name()) + ", expected " + expected);
}

double finite_number(const Json& value, const char* key, const std::string& where) {
  if (!value.is_number()) throw_type(key, where, "a number", value);
  const double number = value.get<double>();
  if (!std::isfinite(number)) throw InputError(where, std::string(key) + " is not finite");
  return number;
}

std::string string_of(const Json& value, const char* key, const std::string& where) {
  if (!value.is_string()) throw_type(key, where, "a string", value);
  return value.get<std::string>();
}

}  // namespace

std::string describe_json_error(std::string_view text, const Json::parse_error& error) {
  // The parser counts bytes from 1, up to the one that does not fit.
  const std::size_t at = std::min(std::max<std::size_t>(error.byte, 1) - 1, text.size());
  const std::string_view before = text.substr(0, at);
  const std::size_t line_start = before.rfind('\n') + 1;  // npos + 1 is 0: the first line
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const auto is_continuation = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; };
  const auto column = 1 + std::count_if(before.begin() + static_cast<std::ptrdiff_t>(line_start), before.end(),
                                        [&](char c) { return !is_continuation(c); });
  return "line " + std::to_string(line) + ", column " + std::to_string(column) + ": " +
         cause_of(text, at, error.what());
}

Json parse_json(std::string_view text, const std::string& name, const JsonLimits& limits) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.size() > limits.max_bytes) {
    throw InputError(name, "JSON of " + std::to_string(text.size()) + " bytes; at most " +
                               std::to_string(limits.max_bytes) + " are read");
  }
  if (const int depth = bracket_depth(text); depth > limits.max_depth) {
    throw InputError(name, "JSON nested " + std::to_string(depth) + " deep; at most " +
                               std::to_string(limits.max_depth) + " are read");
  }
  try {
    return Json::parse(text.begin(), text.end());
  } catch (const Json::parse_error& error) {
    throw InputError(name, "not valid JSON at " + describe_json_error(text, error));
  } catch (const Json::exception& error) {
    throw InputError(name, std::string("not usable JSON: ") + error.what());
  }
}

const Json* find_member(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto it = object.find(key);
  return it == object.end() || it->is_null() ? nullptr : &*it;
}

const Json* find_object(const Json& object, const char* key, const std::string& where) {
  const Json* member = find_member(object, key);
  if (member != nullptr && !member->is_object()) throw_type(key, where, "an object", *member);
  return member;
}

const Json* find_array(const Json& object, const char* key, const std::string& where) {
  const Json* member = find_member(object, key);
  if (member != nullptr && !member->is_array()) throw_type(key, where, "an array", *member);
  return member;
}

std::optional<double> find_number(const Json& object, const char* key, const std::string& where) {
  const Json* member = find_member(object, key);
  return member == nullptr ? std::nullopt : std::optional(finite_number(*member, key, where));
}

std::optional<std::string> find_string(const Json& object, const char* key, const std::string& where) {
  const Json* member = find_member(object, key);
  return member == nullptr ? std::nullopt : std::optional(string_of(*member, key, where));
}

std::optional<std::string> find_version(const Json& object, const char* key, const std::string& where) {
  const Json* member = find_member(object, key);
  return member != nullptr && member->is_number() ? std::optional(member->dump()) : find_string(object, key, where);
}

std::optional<bool> find_bool(const Json& object, const char* key, const std::string& where) {
  const Json* member = find_member(object, key);
  if (member == nullptr) return std::nullopt;
  if (!member->is_boolean()) throw_type(key, where, "true or false", *member);
  return member->get<bool>();
}

std::optional<std::size_t> find_index(const Json& object, const char* key, const std::string& where, std::size_t max) {
  const std::optional<double> number = find_number(object, key, where);
  if (!number) return std::nullopt;
  if (*number < 0 || *number > static_cast<double>(max) || *number != std::floor(*number)) {
    throw InputError(where, std::string(key) + " is not a whole number from 0 to " + std::to_string(max));
  }
  return static_cast<std::size_t>(*number);
}

std::optional<std::vector<double>> find_numbers(const Json& object, const char* key, std::size_t count,
                                                const std::string& where) {
  const Json* array = find_array(object, key, where);
  if (array == nullptr) return std::nullopt;
  if (count != 0 && array->size() != count) {
    throw InputError(where, std::string(key) + " has " + std::to_string(array->size()) + " numbers, expected " +
                                std::to_string(count));
  }
  std::vector<double> numbers;
  numbers.reserve(array->size());
  for (const Json& value : *array) numbers.push_back(finite_number(value, key, where));
  return numbers;
}

std::vector<std::string> find_strings(const Json& object, const char* key, const std::string& where) {
  std::vector<std::string> strings;
  if (const Json* array = find_array(object, key, where)) {
    for (const Json& value : *array) strings.push_back(string_of(value, key, where));
  }
  return strings;
}

}  // namespace tileflight::tile_content
