#include "tileflight/geometry/lzf.h"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace tileflight::geometry {
namespace {

constexpr std::size_t kMostLiterals = 32;
constexpr std::size_t kLongestCopy = 264;
constexpr std::size_t kFarthestCopy = 8192;

/// Takes the next byte; 256 at the end.
unsigned take_byte(std::string_view& input) {
  if (input.empty()) return 256;
  const auto byte = static_cast<unsigned char>(input.front());
  input.remove_prefix(1);
  return byte;
}

/// Carries out a copy token with first byte `control`; false when it is cut off or reaches before the start.
bool expand_copy(unsigned control, std::string_view& input, std::string& output) {
  std::size_t length = control >> 5;
  if (length == 7) {
    const unsigned more = take_byte(input);
    if (more > 255) return false;
    length += more;
  }
  length += 2;
  const unsigned low = take_byte(input);
  if (low > 255) return false;
  const std::size_t distance = ((control & 31U) << 8 | low) + 1;
  if (distance > output.size()) return false;
  // Byte by byte: a copy may overlap what it writes.
  for (std::size_t i = 0; i < length; ++i) output.push_back(output[output.size() - distance]);
  return true;
}

void append_literals(std::string_view literals, std::string& output) {
  for (; !literals.empty(); literals.remove_prefix(std::min(kMostLiterals, literals.size()))) {
    const std::string_view run = literals.substr(0, kMostLiterals);
    output += static_cast<char>(run.size() - 1);
    output += run;
  }
}

void append_copy(std::size_t length, std::size_t distance, std::string& output) {
  const std::size_t code = length - 2;
  const std::size_t high = (distance - 1) >> 8;
  output += static_cast<char>(std::min<std::size_t>(code, 7) << 5 | high);
  if (code >= 7) output += static_cast<char>(code - 7);
  output += static_cast<char>((distance - 1) & 255);
}

std::uint32_t hash_at(std::string_view input, std::size_t i) {
  const auto at = [&](std::size_t k) { return static_cast<std::uint32_t>(static_cast<unsigned char>(input[k])); };
  return ((at(i) << 16 | at(i + 1) << 8 | at(i + 2)) * 2654435761U) >> 16;
}

std::size_t match_length(std::string_view input, std::size_t a, std::size_t b) {
  const std::size_t most = std::min(kLongestCopy, input.size() - b);
  std::size_t length = 0;
  while (length < most && input[a + length] == input[b + length]) ++length;
  return length;
}

}  // namespace

std::optional<std::string> lzf_expanded(std::string_view input, std::size_t size) {
  std::string output;
  output.reserve(std::min(size, input.size() * kLongestCopy));
  while (!input.empty() && output.size() <= size) {
    const unsigned control = take_byte(input);
    if (control < kMostLiterals) {
      if (input.size() < control + 1) return std::nullopt;
      output += input.substr(0, control + 1);
      input.remove_prefix(control + 1);
    } else if (!expand_copy(control, input, output)) {
      return std::nullopt;
    }
  }
  if (output.size() != size) return std::nullopt;
  return output;
}

std::string lzf_compressed(std::string_view input) {
  std::string output;
  std::vector<std::size_t> last_seen(std::size_t{1} << 16, std::string_view::npos);
  std::size_t literals_from = 0;
  std::size_t i = 0;
  while (i + 2 < input.size()) {
    std::size_t& seen = last_seen[hash_at(input, i)];
    const bool reachable = seen != std::string_view::npos && i - seen <= kFarthestCopy;
    const std::size_t length = reachable ? match_length(input, seen, i) : 0;
    const std::size_t distance = i - seen;
    seen = i;
    if (length < 3) {
      ++i;
      continue;
    }
    append_literals(input.substr(literals_from, i - literals_from), output);
    append_copy(length, distance, output);
    i += length;
    literals_from = i;
  }
  append_literals(input.substr(literals_from), output);
  return output;
}

}  // namespace tileflight::geometry
