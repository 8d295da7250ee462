#include "tileflight/capture/recording/content_memory.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/core/base/formatted_text.h"

namespace tileflight::recording {

std::vector<const imaging::RgbImage*> textures_of(const std::vector<imaging::TexturedMesh>& meshes) {
  std::vector<const imaging::RgbImage*> textures;
  for (const imaging::TexturedMesh& mesh : meshes) {
    for (const auto& image : {mesh.texture, mesh.opacity}) {
      if (image && std::ranges::find(textures, image.get()) == textures.end()) textures.push_back(image.get());
    }
  }
  return textures;
}

ContentMemory memory_of(const std::vector<imaging::TexturedMesh>& meshes) {
  ContentMemory memory;
  for (const imaging::TexturedMesh& mesh : meshes) {
    memory.decoded_bytes += render::decoded_bytes(mesh);
    memory.rendered_bytes += render::rendered_bytes(mesh);
  }
  for (const imaging::RgbImage* texture : textures_of(meshes)) {
    memory.textures.push_back(
        {memory.textures.size(), texture->pixels.size() * sizeof(imaging::Rgb8), render::rendered_bytes(*texture)});
  }
  return memory;
}

std::uintmax_t MemorySum::bytes_of(const ContentMemory& content, std::size_t file, bool is_rendered) const {
  std::uintmax_t bytes = is_rendered ? content.rendered_bytes : content.decoded_bytes;
  for (const ContentMemory::Texture& texture : content.textures) {
    if (!textures_.contains({file, texture.number}))
      bytes += is_rendered ? texture.rendered_bytes : texture.decoded_bytes;
  }
  return bytes;
}

void MemorySum::add(const ContentMemory& content, std::size_t file, bool is_rendered) {
  bytes_ += bytes_of(content, file, is_rendered);
  for (const ContentMemory::Texture& texture : content.textures) textures_.emplace(file, texture.number);
}

namespace {

using tileset::CutContent;

/// Sizes of files: of all contents, and of their distinct files.
struct FileSizes {
  double contents = 0.0, files = 0.0;
};

/// Memory of contents, estimated from the sizes of their files: geometry belongs to each content, textures to a file.
class MemoryEstimator {
 public:
  explicit MemoryEstimator(FlightTiles& tiles) : tiles_(&tiles) {}

  FileSizes sizes_of(const std::vector<CutContent>& contents) {
    FileSizes sizes;
    std::set<std::string> files;
    for (const CutContent& content : contents) {
      const double bytes = size_of(content);
      sizes.contents += bytes;
      if (files.insert(content.uri).second) sizes.files += bytes;
    }
    return sizes;
  }

  /// Reads these contents, and learns from them what others take.
  void learn(const std::vector<std::size_t>& numbers) {
    const std::vector<tileset::LoadedContent> loaded = tiles_->read(numbers);
    std::vector<CutContent> contents;
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      contents.push_back(tiles_->content(numbers[k]));
      const ContentMemory memory = memory_of(loaded[k].meshes);
      geometry_bytes_ += static_cast<double>(memory.rendered_bytes);
      if (!files_.insert(contents.back().uri).second) continue;
      for (const auto& texture : memory.textures) texture_bytes_ += static_cast<double>(texture.rendered_bytes);
      learnt_.files += size_of(contents.back());
    }
    learnt_.contents += sizes_of(contents).contents;
  }
  double learnt_bytes() const { return geometry_bytes_ + texture_bytes_; }

  double estimated_bytes(const std::vector<CutContent>& contents) {
    const FileSizes sizes = sizes_of(contents);
    const double geometry = learnt_.contents > 0.0 ? geometry_bytes_ / learnt_.contents : 0.0;
    const double textures = learnt_.files > 0.0 ? texture_bytes_ / learnt_.files : 0.0;
    return geometry * sizes.contents + textures * sizes.files;
  }

 private:
  /// All files count alike if the source does not know their sizes.
  double size_of(const CutContent& content) {
    const auto [known, is_new] = sizes_.emplace(content.uri, 1.0);
    if (is_new) known->second = static_cast<double>(tiles_->file_bytes(content).value_or(1));
    return known->second;
  }

  FlightTiles* tiles_;
  std::map<std::string, double> sizes_;
  std::set<std::string> files_;  ///< learnt from
  FileSizes learnt_;
  double geometry_bytes_ = 0.0, texture_bytes_ = 0.0;
};

std::vector<std::size_t> numbers_for(const FlightTiles& tiles, std::size_t frame) {
  const std::vector<std::size_t>& all = tiles.contents_of_group(tiles.groups().group_of_frame[frame]);
  std::vector<std::size_t> numbers;
  for (const std::size_t place : tiles.places_for_frame(frame)) numbers.push_back(all[place]);
  return numbers;
}

std::vector<CutContent> contents_of(const FlightTiles& tiles, const std::vector<std::size_t>& numbers) {
  std::vector<CutContent> contents;
  for (const std::size_t number : numbers) contents.push_back(tiles.content(number));
  return contents;
}

/// Every nth of the contents, at most `count`.
std::vector<std::size_t> evenly_chosen(const std::vector<std::size_t>& numbers, std::size_t count) {
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < std::min(count, numbers.size()); ++k)
    chosen.push_back(numbers[k * numbers.size() / std::min(count, numbers.size())]);
  return chosen;
}

/// The frame whose contents have the largest files.
std::size_t largest_frame(const FlightTiles& tiles, MemoryEstimator& estimator,
                          const std::vector<std::size_t>& frames) {
  std::vector<double> sizes;
  for (const std::size_t frame : frames)
    sizes.push_back(estimator.sizes_of(contents_of(tiles, numbers_for(tiles, frame))).contents);
  return frames[static_cast<std::size_t>(std::ranges::max_element(sizes) - sizes.begin())];
}

constexpr double kSurely = 0.7;  // of a limit: estimates may be that much too low

/// Reads the contents of a frame until they exceed the limit. Returns what was learnt from reading them; nullopt if
/// they fit.
std::optional<MemoryEstimator> measure_excess(FlightTiles& tiles, MemoryEstimator& estimator, std::size_t frame,
                                              double limit_bytes) {
  constexpr std::size_t kAtOnce = 32;
  const std::vector<std::size_t> numbers = numbers_for(tiles, frame);
  if (estimator.estimated_bytes(contents_of(tiles, numbers)) <= kSurely * limit_bytes) return std::nullopt;
  MemoryEstimator measured(tiles);
  for (std::size_t k = 0; k < numbers.size(); k += kAtOnce) {
    const auto first = numbers.begin() + static_cast<std::ptrdiff_t>(k);
    measured.learn({first, first + static_cast<std::ptrdiff_t>(std::min(kAtOnce, numbers.size() - k))});
    if (measured.learnt_bytes() > limit_bytes) return measured;
  }
  return std::nullopt;
}

/// Whether even files that are very well compressed would fit.
bool surely_fits(FlightTiles& tiles, std::uintmax_t max_memory_bytes) {
  constexpr std::uintmax_t kMostPerFileByte = 400, kMostPerFile = std::uintmax_t{64} << 20;
  std::uintmax_t bytes = 0;
  for (std::size_t i = 0; i < tiles.content_count(); ++i) {
    const std::optional<std::uintmax_t> file = tiles.file_bytes(tiles.content(i));
    bytes += file ? *file * kMostPerFileByte : kMostPerFile;
    if (bytes > max_memory_bytes) return false;
  }
  return true;
}

/// Two significant digits, rounded up.
double rounded_up(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1.0);
  return std::ceil(value / unit) * unit;
}

/// A pixel error at which the frame fits; nullopt: none within reason.
std::optional<double> fitting_error_px(FlightTiles& tiles, MemoryEstimator& estimator, std::size_t frame,
                                       double limit_bytes) {
  constexpr double kStep = 1.3, kMost = 32.0, kMargin = 0.9;
  if (!tiles.error_px()) return std::nullopt;
  for (double factor = kStep; factor < kMost; factor *= kStep) {
    const double error_px = rounded_up(*tiles.error_px() * factor);
    if (estimator.estimated_bytes(tiles.contents_for_frame(frame, error_px)) <= kMargin * limit_bytes) return error_px;
  }
  return std::nullopt;
}

tileset::MemoryLimitExceeded refusal(FlightTiles& tiles, MemoryEstimator& estimator, std::size_t frame,
                                     double needed_bytes, double limit_bytes) {
  const std::optional<double> error_px = fitting_error_px(tiles, estimator, frame, limit_bytes);
  const std::string coarser = error_px           ? base::formatted("--pixel-error %g", *error_px)
                              : tiles.error_px() ? std::string("--pixel-error")
                                                 : std::string("--error, --pixel-error");
  return {tiles.name(), base::formatted("the tiles of frame %zu need about %.2g GB, more than %.3g GB of memory: raise "
                                        "the limit (--memory %g) or request coarser tiles (%s)",
                                        frame, 1e-9 * needed_bytes, 1e-9 * limit_bytes,
                                        rounded_up(1.1e-9 * needed_bytes), coarser.c_str())};
}

}  // namespace

void require_frames_fit(FlightTiles& tiles, const std::vector<std::size_t>& frames, std::uintmax_t max_memory_bytes,
                        const Progress& progress) {
  constexpr std::size_t kProbes = 24;
  if (frames.empty() || surely_fits(tiles, max_memory_bytes)) return;
  const auto limit_bytes = static_cast<double>(max_memory_bytes);
  MemoryEstimator estimator(tiles);
  const std::size_t frame = largest_frame(tiles, estimator, frames);
  const std::vector<std::size_t> numbers = numbers_for(tiles, frame);
  if (numbers.empty()) return;
  report_progress(progress, 0, 0, "estimating memory");
  estimator.learn(evenly_chosen(numbers, kProbes));
  std::optional<MemoryEstimator> excess = measure_excess(tiles, estimator, frame, limit_bytes);
  if (!excess) return;
  const double needed = std::max(excess->learnt_bytes(), excess->estimated_bytes(contents_of(tiles, numbers)));
  throw refusal(tiles, *excess, frame, needed, limit_bytes);
}

}  // namespace tileflight::recording
