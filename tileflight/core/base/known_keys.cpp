#include "tileflight/core/base/known_keys.h"

#include <algorithm>
#include <numeric>

namespace tileflight::base {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  // Wagner and Fischer (Journal of the ACM 21(1), 1974), one row at a time: row[j] = distance(a[0..i), b[0..j)).
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

std::string nearest_key(std::string_view unknown, const std::vector<std::string>& known) {
  const auto nearest = std::min_element(known.begin(), known.end(), [&](const std::string& a, const std::string& b) {
    return edit_distance(unknown, a) < edit_distance(unknown, b);
  });
  return nearest == known.end() ? std::string() : *nearest;
}

std::string did_you_mean(std::string_view unknown, const std::vector<std::string>& known) {
  const std::string nearest = nearest_key(unknown, known);
  const std::size_t longer = std::max(unknown.size(), nearest.size());
  const bool is_beginning = unknown.size() >= 3 && nearest.starts_with(unknown);
  // Allows two of five letters to differ, plus one transposition in short words.
  if (nearest.empty() || (!is_beginning && 5 * edit_distance(unknown, nearest) > 2 * longer + 2)) return "";
  return "; did you mean '" + nearest + "'?";
}

}  // namespace tileflight::base
