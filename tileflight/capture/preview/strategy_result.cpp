#include "tileflight/capture/preview/strategy_result.h"

#include <algorithm>
#include <cmath>

#include "tileflight/world/scene/scene.h"
#include "tileflight/tiles/tileset/view_cone_tree.h"

namespace tileflight::preview {
namespace {

std::vector<bool> nodes_in_memory(const ContentIds& ids, const CoverageContents& contents, std::size_t nodes) {
  std::vector<bool> in_memory(nodes);
  for (const std::uint32_t id : ids) in_memory[contents[id].node] = true;
  return in_memory;
}

class FramePixelCounter {
 public:
  FramePixelCounter(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const tileset::TilesetTree& tree, const CoverageSettings& settings, const Progress& progress)
      : watch_(watch),
        contents_(contents),
        tree_(tree),
        settings_(settings),
        progress_(progress),
        rays_(pixel_rays(scale_to_width(watch.camera, settings.width))),
        parts_(contents.scene_groups(truth)),
        anchor_(contents.bounds(truth).center()),
        substitutes_(contents.size()) {
    for (const std::uint32_t id : truth) substitutes_[id] = find_substitutes(tree, contents[id]);
  }

  void count(std::vector<StrategyResult>& all) {
    constexpr std::uintmax_t kPixelsDivisor = 16;  // share of the memory limit for the frames' pixels
    const std::size_t frames = watch_.frames.size();
    const std::size_t at_once = static_cast<std::size_t>(std::clamp<std::uintmax_t>(
        contents_.max_memory_bytes() / kPixelsDivisor / (rays_.size() * sizeof(PixelHit)), 1, frames));
    for (std::size_t begin = 0; begin < frames; begin += at_once) {
      const std::size_t end = std::min(frames, begin + at_once);
      const std::vector<std::vector<PixelHit>> hits = trace(begin, end);
      for (std::size_t i = begin; i < end; ++i) count_frame(i, hits[i - begin], all);
    }
  }

 private:
  std::vector<std::vector<PixelHit>> trace(std::size_t begin, std::size_t end) {
    std::vector<std::vector<PixelHit>> hits(end - begin, std::vector<PixelHit>(rays_.size()));
    const tileset::ViewCone lens = tileset::view_cone_of(watch_.camera);
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      CoverageContents::OwnedMeshes meshes = contents_.meshes(parts_[k], false);
      const scene::Scene part(std::move(meshes.meshes), anchor_);
      const geometry::Box3& bounds = part.bounds();
      for (std::size_t i = begin; i < end; ++i) {
        tileset::ViewCone view = lens;
        view.position = watch_.pose(i).translation;
        view.axis = watch_.pose(i).rotation * geometry::Vec3::UnitZ();
        if (!tileset::intersects_cone(view, {bounds.center(), bounds.sizes().norm() / 2})) continue;
        trace_pixels(part, meshes.content_of_mesh, rays_, watch_.pose(i), hits[i - begin]);
      }
      // Of all groups of frames: one more part of one group is done.
      const double done = static_cast<double>(begin) * static_cast<double>(parts_.size()) +
                          static_cast<double>((end - begin) * (k + 1));
      report_progress(progress_, std::llround(done / static_cast<double>(parts_.size())),
                      static_cast<std::int64_t>(watch_.frames.size()), "checking frames");
    }
    return hits;
  }

  void count_frame(std::size_t i, const std::vector<PixelHit>& frame, std::vector<StrategyResult>& all) const {
    const double pixels_per_rad = tileset::view_cone_of(watch_.camera).pixels_per_rad;
    for (StrategyResult& result : all) {
      const std::vector<bool> in_memory = nodes_in_memory(result.tiles_at(i), contents_, tree_.node_count());
      result.shares.push_back(count_pixels(frame, substitutes_, in_memory, pixels_per_rad, settings_.error_px));
    }
  }

  const FrameSampling& watch_;
  CoverageContents& contents_;
  const tileset::TilesetTree& tree_;
  const CoverageSettings& settings_;
  const Progress& progress_;
  std::vector<std::optional<geometry::Vec3>> rays_;
  std::vector<ContentIds> parts_;
  geometry::Vec3 anchor_;
  std::vector<std::vector<Substitute>> substitutes_;
};

}  // namespace

std::size_t worst_frame(const StrategyResult& result) {
  const auto missing = [](const PixelCounts& s) { return s.share(s.missing); };
  return static_cast<std::size_t>(std::ranges::max_element(result.shares, {}, missing) - result.shares.begin());
}

void count_pixels_of_frames(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                            const tileset::TilesetTree& tree, const CoverageSettings& settings, const Progress& progress,
                            std::vector<StrategyResult>& all) {
  FramePixelCounter(watch, contents, truth, tree, settings, progress).count(all);
}

}  // namespace tileflight::preview
