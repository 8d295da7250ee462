#include "tileflight/core/base/input_error.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"

/// The metadata track of a video: the first byte chooses GoPro's format or DJI's, then samples follow, each behind two
/// bytes of its length.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  if (size == 0) return 0;
  std::span<const std::byte> rest(reinterpret_cast<const std::byte*>(data), size);
  const bool is_gopro = (data[0] & 1U) == 0;
  rest = rest.subspan(1);
  std::vector<base::TimedBytes> samples;
  while (rest.size() >= 2) {
    const std::size_t length = std::min<std::size_t>(base::read_big_endian<std::uint16_t>(rest, 0), rest.size() - 2);
    const auto sample = rest.subspan(2, length);
    samples.push_back({static_cast<double>(samples.size()), 1.0, {sample.begin(), sample.end()}});
    rest = rest.subspan(2 + length);
  }
  try {
    const flight_logs::MetadataSource source{.where = "fuzz.mp4"};
    if (is_gopro) {
      flight_logs::read_gpmf(samples, source);
    } else {
      flight_logs::read_dji_metadata(samples, source);
    }
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
