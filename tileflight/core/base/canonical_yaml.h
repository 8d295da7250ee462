#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace tileflight::base {

/// Canonical one-line text of a YAML node: equivalent nodes give the same text. Comments, key order, quotes, block or
/// flow style and number notation make no difference; `${NAME}` is replaced where the variable is set. Throws
/// InputError for nodes nested deeper than settings files are.
std::string canonical_yaml(const YAML::Node& node);

/// canonical_yaml() of a parsed text; the text unchanged if it is not a YAML map (another calibration format, for
/// example).
std::string canonical_yaml_text(const std::string& text);

}  // namespace tileflight::base
