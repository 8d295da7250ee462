#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tileflight/base/doubt.h"

namespace tileflight::evaluation {

/// [{what, where, how_sure, what_to_do}], the key `doubts` of results.
nlohmann::json to_json(const Doubts& doubts);

/// The inverse. Throws InputError (`where`, cause) if the JSON has another form.
Doubts doubts_from_json(const nlohmann::json& list, const std::string& where);

}  // namespace tileflight::evaluation
