#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tileflight::base {

/// Least number of single-character insertions, deletions and substitutions that turn `a` into `b` (Levenshtein 1966).
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The known key closest to `unknown` in spelling (smallest edit distance, first on ties), for messages such as
/// "unknown key 'fsp', did you mean 'fps'?". Empty if there are no known keys.
std::string nearest_key(std::string_view unknown, const std::vector<std::string>& known);

/// "; did you mean 'fps'?" to end a message, if a known key is spelled similarly (at most half of the letters differ);
/// otherwise empty.
std::string did_you_mean(std::string_view unknown, const std::vector<std::string>& known);

}  // namespace tileflight::base
