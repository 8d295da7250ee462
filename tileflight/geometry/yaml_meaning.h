#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace tileflight::geometry {

/// What a YAML node says, on one line: the same text for whatever says the same. Comments, the order of keys, quotes,
/// the style of lists and maps and the way in which a number is written do not matter; `${NAME}` is filled in where the
/// variable is set. Throws InputError for nodes deeper than files of settings are.
std::string meaning_of(const YAML::Node& node);

/// The same of a text; the text itself where it is no map in YAML (another format of calibration, say).
std::string meaning_of_text(const std::string& text);

}  // namespace tileflight::geometry
