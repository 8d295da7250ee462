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

}  // namespace tileflight::geometry
