#pragma once

#include <string>
#include <vector>

namespace tileflight {

/// Something that may make a result wrong, found by the program and said with the result.
struct Doubt {
  std::string what;        ///< one sentence, with the numbers that speak
  std::string where;       ///< stage, frames or files
  std::string how_sure;    ///< "certain", "likely" or "possible"
  std::string what_to_do;  ///< one sentence
};

using Doubts = std::vector<Doubt>;

/// Whether no verdict may rest on what is doubted: one that is only possible stands beside the verdict.
inline bool forbids_verdict(const Doubt& doubt) { return doubt.how_sure != "possible"; }

}  // namespace tileflight
