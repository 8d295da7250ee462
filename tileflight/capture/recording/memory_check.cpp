#include "tileflight/capture/recording/memory_check.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/capture/recording/content_memory.h"
#include "tileflight/capture/recording/image_division.h"

namespace tileflight::recording {
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

std::vector<std::size_t> numbers_for(const FlightTiles& tiles, const FrameView& view) {
  const std::vector<std::size_t>& all = tiles.contents_of_group(tiles.groups().group_of_frame[view.frame]);
  std::vector<std::size_t> numbers;
  for (const std::size_t place : tiles.places_for_view(view)) {
    if (!view.contents || view.contents->contains(all[place])) numbers.push_back(all[place]);
  }
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
    sizes.push_back(estimator.sizes_of(contents_of(tiles, numbers_for(tiles, {frame}))).contents);
  return frames[static_cast<std::size_t>(std::ranges::max_element(sizes) - sizes.begin())];
}

/// Of the regions that a frame is divided into, within the budget if possible, the one that needs most memory.
FrameView most_demanding_region(const FlightTiles& tiles, MemoryEstimator& estimator, const imaging::Camera& camera,
                                std::size_t frame, double budget_bytes) {
  const auto bytes_of = [&](const FrameView& view) {
    return estimator.estimated_bytes(contents_of(tiles, numbers_for(tiles, view)));
  };
  const RegionBytes bytes_of_region = [&](const imaging::PixelRegion& region) {
    return bytes_of({frame, region, Sight::kPicture});
  };
  std::vector<FrameView> views;
  for (const auto& region : divide_image(camera.width(), camera.height(), bytes_of_region, budget_bytes))
    views.push_back({frame, region, Sight::kPicture});
  std::vector<double> bytes;
  std::ranges::transform(views, std::back_inserter(bytes), bytes_of);
  return views[static_cast<std::size_t>(std::ranges::max_element(bytes) - bytes.begin())];
}

constexpr double kSurely = 0.7;  // of a limit: estimates may be that much too low

/// Of the contents of a frame's picture, the one with the largest file.
FrameView largest_tile(const FlightTiles& tiles, MemoryEstimator& estimator, std::size_t frame) {
  const std::vector<std::size_t> numbers = numbers_for(tiles, {frame, {}, Sight::kPicture});
  const auto largest = std::ranges::max_element(
      numbers, {}, [&](std::size_t number) { return estimator.sizes_of({tiles.content(number)}).contents; });
  return {frame, {}, Sight::kPicture, ContentRange{*largest, *largest + 1}};
}

/// What of a frame that does not fit must be in memory at once, and needs most of it, as the frame is divided.
FrameView most_demanding_part(const FlightTiles& tiles, MemoryEstimator& estimator, const PlannedCamera& camera,
                              std::size_t frame, double budget_bytes) {
  if (numbers_for(tiles, {frame, {}, Sight::kPicture}).empty()) return {frame};
  return render::has_one_ray_per_pixel(camera.options)
             ? largest_tile(tiles, estimator, frame)
             : most_demanding_region(tiles, estimator, camera.calibration.camera, frame, budget_bytes);
}

/// Whether a view's contents do not fit, and what was learnt from reading them; nullopt: they fit.
std::optional<MemoryEstimator> measure_excess(FlightTiles& tiles, MemoryEstimator& estimator, const FrameView& view,
                                              double limit_bytes) {
  constexpr std::size_t kAtOnce = 32;
  const std::vector<std::size_t> numbers = numbers_for(tiles, view);
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

/// A pixel error at which the view fits; nullopt: none within reason.
std::optional<double> fitting_error_px(FlightTiles& tiles, MemoryEstimator& estimator, const FrameView& view,
                                       double limit_bytes) {
  constexpr double kStep = 1.3, kMost = 32.0, kMargin = 0.9;
  if (!tiles.error_px()) return std::nullopt;
  for (double factor = kStep; factor < kMost; factor *= kStep) {
    const double error_px = rounded_up(*tiles.error_px() * factor);
    if (estimator.estimated_bytes(tiles.contents_for_view(view, error_px)) <= kMargin * limit_bytes) return error_px;
  }
  return std::nullopt;
}

tileset::MemoryLimitExceeded refusal(FlightTiles& tiles, MemoryEstimator& estimator, const FrameView& view,
                                   double needed_bytes, const MemoryLimits& limits) {
  const double limit_bytes = view.region || view.contents ? limits.part : limits.frame;
  const double memory_bytes = limits.frame * needed_bytes / limit_bytes;  // with the images of a divided frame
  const std::string memory = base::formatted(
      "need about %.2g GB, more than %.3g GB of memory: raise the limit "
      "(--memory %g)",
      1e-9 * memory_bytes, 1e-9 * limits.frame, rounded_up(1.1e-9 * memory_bytes));
  if (view.contents) {
    const CutContent& tile = tiles.content(view.contents->begin);
    return {tiles.name(),
            base::formatted("a tile of frame %zu (%s) and its image %s", view.frame, tile.uri.c_str(), memory.c_str())};
  }
  const std::optional<double> error_px = fitting_error_px(tiles, estimator, view, limit_bytes);
  const std::string pixels =
      view.region ? base::formatted("%d x %d pixels of ", view.region->width(), view.region->height()) : std::string();
  const std::string coarser = error_px           ? base::formatted("--pixel-error %g", *error_px)
                              : tiles.error_px() ? std::string("--pixel-error")
                                                 : std::string("--error, --pixel-error");
  return {tiles.name(), base::formatted("the tiles of %sframe %zu %s or request coarser tiles (%s)", pixels.c_str(),
                                        view.frame, memory.c_str(), coarser.c_str())};
}

}  // namespace

void require_frames_fit(FlightTiles& tiles, const PlannedFlight& mission, const std::vector<std::size_t>& frames,
                        const MemoryLimits& limits, const Progress& progress) {
  constexpr std::size_t kProbes = 24;
  if (frames.empty() || surely_fits(tiles, static_cast<std::uintmax_t>(limits.frame))) return;
  MemoryEstimator estimator(tiles);
  FrameView view{largest_frame(tiles, estimator, frames)};
  const std::vector<std::size_t> numbers = numbers_for(tiles, view);
  if (numbers.empty()) return;
  report_progress(progress, 0, 0, "estimating memory");
  estimator.learn(evenly_chosen(numbers, kProbes));
  std::optional<MemoryEstimator> excess = measure_excess(tiles, estimator, view, limits.frame);
  if (excess && may_divide_images(mission)) {
    const FrameView picture{view.frame, {}, Sight::kPicture};
    const PlannedCamera& camera = mission.camera(tiles.images()[view.frame].camera);
    view = most_demanding_part(tiles, estimator, camera, view.frame, kSurely * limits.part);
    excess = measure_excess(tiles, estimator, view, limits.part);
    if (excess && !measure_excess(tiles, estimator, picture, limits.frame)) return;
  }
  if (!excess) return;
  const double needed =
      std::max(excess->learnt_bytes(), excess->estimated_bytes(contents_of(tiles, numbers_for(tiles, view))));
  throw refusal(tiles, *excess, view, needed, limits);
}

}  // namespace tileflight::recording
