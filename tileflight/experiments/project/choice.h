#pragma once

#include <string>

namespace tileflight::project {

/// Tells how sure a choice is.
enum class Certainty {
  kCertain,  ///< the recording or the user states it
  kLikely,   ///< measured or concluded, with a check
  kGuess,    ///< to be checked by the user
};

/// Returns "certain", "likely" or "a guess".
inline const char* to_string(Certainty certainty) {
  return certainty == Certainty::kCertain ? "certain" : certainty == Certainty::kLikely ? "likely" : "a guess";
}

/// Holds a setting of an experiment that was chosen from what a recording says.
struct Choice {
  std::string section;  ///< of the experiment, "place" or "real.ingest"
  std::string key;      ///< "every"
  std::string value;    ///< as YAML has it; empty: the key is left out
  std::string reason;   ///< one sentence without a full stop
  Certainty certainty = Certainty::kCertain;
};

}  // namespace tileflight::project
