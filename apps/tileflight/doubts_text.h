#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace tileflight::app {

/// The `doubts` of a result, one line each, most certain first; empty if there are none.
std::string doubts_text(const nlohmann::json& result);

}  // namespace tileflight::app
