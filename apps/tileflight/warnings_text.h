#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace tileflight::app {

/// The `warnings` of a result, one line each, most certain first; empty if there are none.
std::string warnings_text(const nlohmann::json& result);

}  // namespace tileflight::app
