#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/geometry/doubt.h"

namespace tileflight::evaluation {

/// [{what, where, how_sure, what_to_do}], the key `doubts` of results.
nlohmann::json to_json(const Doubts& doubts);

/// The inverse. Throws InputError (`where`, cause) for what is no such list.
Doubts doubts_from_json(const nlohmann::json& list, const std::string& where);

}  // namespace tileflight::evaluation
