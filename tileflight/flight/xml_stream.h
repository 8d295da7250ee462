#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace tileflight::flight {

/// What read_xml tells while it reads. Names come without their namespace's prefix (`gx:coord` is "coord"). Each
/// returns whether to go on.
struct XmlEvents {
  using Attributes = std::map<std::string, std::string, std::less<>>;
  std::function<bool(std::string_view name, const Attributes& attributes)> start;
  /// `text`: the characters since the last tag, so the whole content of an element that holds no others; at most 4096.
  std::function<bool(std::string_view name, std::string_view text)> end;
};

/// Reads XML of unknown origin as far as it is well-formed (Expat). Documents that declare a type (`<!DOCTYPE`) are
/// refused with an InputError that names `where`: only there can entities be defined, and no flight log needs them.
/// Elements nest at most 64 deep. Returns where and why it ended early ("line 12: unclosed token"); empty: at the end
/// or stopped by an event.
std::string read_xml(std::string_view text, const std::string& where, const XmlEvents& events);

/// The warning of a log that read_xml left early.
inline std::string ended_early(const std::string& fault) {
  return "the file breaks at " + fault + "; what stands before is read";
}

}  // namespace tileflight::flight
