#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tileflight::base {
class StrictSection;
}

namespace tileflight {

/// A condition, found by the program, that may make a result wrong; reported with the result.
struct Doubt {
  std::string what;        ///< one sentence, with the relevant numbers
  std::string where;       ///< stage, frames or files
  std::string how_sure;    ///< "certain", "likely" or "possible"
  std::string what_to_do;  ///< one sentence
};

using Doubts = std::vector<Doubt>;

/// True if no verdict may be given because of this doubt; a "possible" doubt is only reported beside the verdict.
inline bool forbids_verdict(const Doubt& doubt) { return doubt.how_sure != "possible"; }

/// Returns the value of the key `doubts` of results: [{what, where, how_sure, what_to_do}].
nlohmann::json to_json(const Doubts& doubts);

/// Reads the key `doubts` of a section; empty if it is absent. Throws InputError as StrictSection does.
Doubts read_doubts(base::StrictSection& section);

}  // namespace tileflight
