#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tileflight::geometry {

/// Least number of single-character insertions, deletions and substitutions that turn `a` into `b` (Levenshtein 1966).
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The known key that is spelled most like `unknown` (smallest edit distance, the first of equals), for messages such
/// as "unknown key 'fsp', did you mean 'fps'?". Empty if there are no known keys.
std::string nearest_key(std::string_view unknown, const std::vector<std::string>& known);

/// "; did you mean 'fps'?" for a key that is spelled nearly like a known one (half of its letters may differ), else
/// empty: the end of a message.
std::string did_you_mean(std::string_view unknown, const std::vector<std::string>& known);

}  // namespace tileflight::geometry
