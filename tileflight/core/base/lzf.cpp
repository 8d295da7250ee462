#include "tileflight/core/base/lzf.h"

#include <lzf.h>

#include <limits>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {
namespace {

constexpr std::size_t kMost = std::numeric_limits<unsigned>::max();

}  // namespace

std::optional<std::string> lzf_decompress(std::string_view input, std::size_t size) {
  if (input.size() > kMost || size > kMost) return std::nullopt;
  if (input.empty() || size == 0) return input.empty() && size == 0 ? std::optional<std::string>("") : std::nullopt;
  std::string output(size, '\0');
  const unsigned written = ::lzf_decompress(input.data(), static_cast<unsigned>(input.size()), output.data(),
                                            static_cast<unsigned>(output.size()));
  if (written != size) return std::nullopt;
  return output;
}

std::string lzf_compress(std::string_view input) {
  if (input.empty()) return {};
  const std::size_t worst = input.size() + input.size() / 32 + 64;  // one control byte per 32 literals
  if (worst > kMost) throw InputError("LZF", "cannot compress 4 GB and more at once");
  std::string output(worst, '\0');
  output.resize(::lzf_compress(input.data(), static_cast<unsigned>(input.size()), output.data(),
                               static_cast<unsigned>(output.size())));
  return output;
}

}  // namespace tileflight::base
