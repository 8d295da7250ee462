#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tileflight/core/base/doubt.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight {

/// [{what, where, how_sure, what_to_do}], the key `doubts` of results.
nlohmann::json to_json(const Doubts& doubts);

/// The key `doubts` of `section`; empty if it is absent. Throws InputError as StrictSection does.
Doubts read_doubts(base::StrictSection& section);

}  // namespace tileflight
