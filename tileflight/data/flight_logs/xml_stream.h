#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace tileflight::flight_logs {

/// Callbacks of read_xml. Names are passed without their namespace prefix (`gx:coord` is "coord"). Each returns whether
/// to continue.
struct XmlEvents {
  using Attributes = std::map<std::string, std::string, std::less<>>;
  std::function<bool(std::string_view name, const Attributes& attributes)> start;
  /// `text`: the characters since the last tag, which is the whole content of an element without children; at most
  /// `longest_text` bytes.
  std::function<bool(std::string_view name, std::string_view text)> end;
  std::size_t longest_text = 4096;
};

/// Reads XML of unknown origin as far as it is well-formed (Expat). Documents that declare a type (`<!DOCTYPE`) are
/// rejected with an InputError that names `where`: only there can entities be defined, and no flight log needs them.
/// Elements nest at most 64 deep. Returns the position and cause of an early end ("line 12: unclosed token"); empty if
/// the end was reached or a callback stopped the parser.
std::string read_xml(std::string_view text, const std::string& where, const XmlEvents& events);

/// The warning for a log that read_xml could not read to its end.
inline std::string early_end_warning(const std::string& fault) {
  return "the file is damaged at " + fault + "; everything before it is used";
}

}  // namespace tileflight::flight_logs
