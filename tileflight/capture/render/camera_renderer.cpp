#include "tileflight/capture/render/camera_renderer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/atmosphere.h"
#include "tileflight/capture/render/block_tracer.h"
#include "tileflight/capture/render/central_rays.h"
#include "tileflight/capture/render/daylight_shader.h"
#include "tileflight/capture/render/ray_table.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/simd.h"

namespace tileflight::render {
namespace {

int samples_along_axis(int samples_per_pixel) {
  for (int n = 1; n <= 4; ++n) {
    if (n * n == samples_per_pixel) return n;
  }
  throw InputError("samples per pixel", "must be 1, 4, 9 or 16, got " + std::to_string(samples_per_pixel));
}

using imaging::PixelRegion;

Haze haze_of(const RenderOptions& options) {
  Haze haze{options.haze_per_m, {}};
  if (!options.haze_color) return haze;
  haze.color.emplace();
  for (std::size_t c = 0; c < 3; ++c) (*haze.color)[c] = SrgbTables::get().decode((*options.haze_color)[c]);
  return haze;
}

std::optional<Atmosphere> atmosphere_of(const RenderOptions& options, const scene::Scene& scene) {
  if (!options.weather || options.weather->is_clear()) return std::nullopt;
  return Atmosphere(*options.weather, options.daylight, options.background, scene.anchor().z());
}

double direct_sun_of(const RenderOptions& options) {
  return options.weather ? direct_sun_share(*options.weather, options.daylight->sun().elevation_rad) : 1.0;
}

/// The moments of an exposure.
struct LightMoments {
  std::span<const RowPoses> all;
  std::size_t at_once;  ///< so many are cast together

  std::size_t middle() const { return all.size() / 2; }
};

void require_a_pose_a_row(std::size_t poses, int height) {
  if (poses != 1 && poses != static_cast<std::size_t>(height)) throw std::invalid_argument("one pose a row");
}

}  // namespace

struct CameraRenderer::Impl {
  const scene::Scene& scene;
  std::shared_ptr<const Appearance> appearance;
  RenderOptions options;
  BlockTracer tracer;
  std::optional<DaylightShader> shader;  // set if `daylight` is used
  std::optional<Atmosphere> atmosphere;  // set if there is weather
  std::shared_ptr<const CameraRays> rays;

  Impl(const scene::Scene& s, std::shared_ptr<const Appearance> a, std::shared_ptr<const CameraRays> r,
       const RenderOptions& o)
      : scene(s),
        appearance(std::move(a)),
        options(o),
        tracer(scene, *appearance, options.background, options.daylight ? 0.0 : options.haze_per_m,
               options.haze_color.value_or(options.background)),
        atmosphere(atmosphere_of(options, scene)),
        rays(std::move(r)) {
    if (options.daylight) shader.emplace(scene, options.daylight, haze_of(options), direct_sun_of(options));
    if (rays->samples_along_axis() != samples_along_axis(options.samples_per_pixel))
      throw std::invalid_argument("rays of another number of samples");
  }

  int width() const { return rays->camera.width(); }
  int height() const { return rays->camera.height(); }
  template <class Work>
  ViewStatistics for_each_tile(const Work& work) const;

  imaging::FloatImage empty_depth() const;
  RowPoses rows_at(const ShutterPoses& poses, int moment) const;
  ViewStatistics trace_central(const PixelRegion& tile, const RowPoses& poses, const CentralRays& wanted,
                               imaging::RgbImage* rgb) const;
  void write_colors(const TracedBeam& beam, imaging::RgbImage& rgb) const;
  void write_air(const TracedBeam::Block& block, const scene::RayPacket8& packet, const SquaredColors8& squares,
                 imaging::RgbImage& rgb) const;
  std::array<LinearRgb, 8> light_through_air(std::uint8_t valid, const scene::RayPacket8& packet,
                                             SquaredColors8& squares) const;
  std::array<LinearRgb, 8> blend_layers(std::uint8_t lanes, const scene::RayPacket8& nearest,
                                        const BlockTextureReads& nearest_reads) const;
  void add_light(const PixelRegion& tile, const LightMoments& moments, const CentralRays& wanted, TileLight& sum,
                 ViewStatistics& view) const;
  void add_light(const TracedBeam& beam, int samples_along_axis, TileLight& sum) const;
  CentralRays wanted(imaging::FloatImage& depth_m, const SurfaceVisitor& visitor) const;
  RenderedFrame render(std::span<const geometry::SE3> poses_of_rows, const SurfaceVisitor& visitor) const;
  LightFrame render_light(const ShutterPoses& poses, const SurfaceVisitor& visitor, const LightSink& sink) const;
  std::size_t moments_at_once(std::span<const RowPoses> moments) const;
};

template <class Work>
ViewStatistics CameraRenderer::Impl::for_each_tile(const Work& work) const {
  const std::vector<PixelRegion> all = tiles_of({0, 0, width(), height()});
  std::vector<ViewStatistics> views(all.size());
  tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) { views[i] = work(all[i]); });
  ViewStatistics sum;
  for (const ViewStatistics& view : views) sum.add(view);
  return sum;
}

imaging::FloatImage CameraRenderer::Impl::empty_depth() const {
  if (!options.depth) return {};
  return {width(), height(), std::numeric_limits<float>::quiet_NaN()};
}

RowPoses CameraRenderer::Impl::rows_at(const ShutterPoses& poses, int moment) const {
  const std::span<const geometry::SE3> all(poses.T_local_camera);
  const auto rows = static_cast<std::size_t>(poses.rows);
  const std::size_t first = static_cast<std::size_t>(moment) * rows;
  const std::span<const float> times(poses.scene_times);
  return {all.subspan(first, rows), scene.anchor(), times.empty() ? times : times.subspan(first, rows)};
}

/// Casts the central rays. `rgb`: of the picture, null: only what is wanted of the rays.
ViewStatistics CameraRenderer::Impl::trace_central(const PixelRegion& tile, const RowPoses& poses,
                                                   const CentralRays& wanted, imaging::RgbImage* rgb) const {
  ViewStatistics view;
  if (rgb == nullptr) {
    TracedBeam beam;
    for_each_beam(tile, 1, [&](int x, int y) {
      tracer.cast(rays->central, x, y, poses, beam);
      note_central(beam, rays->central, wanted, view);
    });
    return view;
  }
  const auto cast = [&](int x, int y, TracedBeam& beam) { tracer.cast(rays->central, x, y, poses, beam); };
  const auto shade = [&](const TracedBeam& beam) {
    note_central(beam, rays->central, wanted, view);
    write_colors(beam, *rgb);
  };
  BeamPipeline pipeline(tracer, cast, shade);
  for_each_beam(tile, 1, [&](int x, int y) { pipeline.push(x, y); });
  pipeline.finish();
  return view;
}

/// Colours of a beam's samples, which are pixels.
TILEFLIGHT_WIDE_VECTORS void CameraRenderer::Impl::write_colors(const TracedBeam& beam, imaging::RgbImage& rgb) const {
  SquaredColors8 squares;
  for (int k = 0; k < beam.size; ++k) {
    const TracedBeam::Block& block = beam.blocks[static_cast<std::size_t>(k)];
    const scene::RayPacket8& packet = beam.packets[static_cast<std::size_t>(k)];
    tracer.shade(block.valid, packet, beam.reads[static_cast<std::size_t>(k)], squares);
    if (atmosphere) {
      atmosphere->wet_surfaces(block.valid, packet, squares);
      write_air(block, packet, squares, rgb);
    } else {
      for_each_lane(block, [&](int i, int column, int row) {
        rgb(column, row) = encode_squared(squares[static_cast<std::size_t>(i)]);
      });
    }
    const BlockTextureReads& reads = beam.reads[static_cast<std::size_t>(k)];
    const std::uint8_t blending = tracer.blending_lanes(block.valid, reads);
    if (blending == 0) [[likely]]
      continue;
    const std::array<LinearRgb, 8> lanes = blend_layers(blending, packet, reads);
    for_each_lane({block.column, block.row, blending}, [&](int i, int column, int row) {
      rgb(column, row) = SrgbTables::get().encode(lanes[static_cast<std::size_t>(i)]);
    });
  }
}

/// Colours of a block that was shaded, as they arrive through the air.
void CameraRenderer::Impl::write_air(const TracedBeam::Block& block, const scene::RayPacket8& packet,
                                     const SquaredColors8& squares, imaging::RgbImage& rgb) const {
  static const PositiveCurve decode([](double square) { return srgb_decode(std::sqrt(square)); }, 17);
  static const PositiveCurve encode([](double light) { return srgb_encode(light) + 0.5; }, 0);
  std::array<LinearRgb, 8> lanes;
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const bool is_valid = (block.valid >> i & 1U) != 0;
    for (int c = 0; c < 3; ++c) lanes[i][static_cast<std::size_t>(c)] = is_valid ? decode.at(squares[i][c]) : 0.0F;
  }
  atmosphere->add_air(block.valid, packet, lanes);
  for_each_lane(block, [&](int i, int x, int y) {
    imaging::Rgb8& pixel = rgb(x, y);
    for (std::size_t c = 0; c < 3; ++c)
      pixel[c] = static_cast<std::uint8_t>(encode.at(lanes[static_cast<std::size_t>(i)][c]));
  });
}

/// Light of a block that was shaded, where lamps or the air change it.
std::array<LinearRgb, 8> CameraRenderer::Impl::light_through_air(std::uint8_t valid, const scene::RayPacket8& packet,
                                                                 SquaredColors8& squares) const {
  if (atmosphere) atmosphere->wet_surfaces(valid, packet, squares);
  std::array<LinearRgb, 8> lanes{};
  if (shader) {
    lanes = shader->shade(valid, packet, squares);
  } else {
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      if ((valid >> i & 1U) == 0) continue;
      Float4 light;
      decode_squared(SrgbTables::get(), squares[i], light);
      lanes[i] = {light[0], light[1], light[2]};
    }
  }
  if (atmosphere) atmosphere->add_air(valid, packet, lanes);
  return lanes;
}

/// Light of the lanes whose nearest surface is partly transparent: each surface along the ray adds the share of its
/// light that the ones before it let through. With the air in between, this is exact: light of a surface behind has
/// crossed the air before the one in front of it, too. `nearest`: the nearest surfaces.
std::array<LinearRgb, 8> CameraRenderer::Impl::blend_layers(std::uint8_t lanes, const scene::RayPacket8& nearest,
                                                            const BlockTextureReads& nearest_reads) const {
  scene::RayPacket8 packet = nearest;
  BlockTextureReads reads = nearest_reads;
  std::array<LinearRgb, 8> sum{};
  std::array<float, 8> share{1, 1, 1, 1, 1, 1, 1, 1};
  SquaredColors8 squares;
  for (int layer = 1; lanes != 0; ++layer) {
    tracer.shade(lanes, packet, reads, squares);
    const std::array<LinearRgb, 8> light = light_through_air(lanes, packet, squares);
    std::uint8_t behind = 0;
    for (unsigned i = 0; i < sum.size(); ++i) {
      if ((lanes >> i & 1U) == 0) continue;
      const float opacity = layer < kMostBlendedSurfaces ? tracer.opacity(packet, reads, static_cast<int>(i)) : 1.0F;
      for (std::size_t c = 0; c < 3; ++c) sum[i][c] += share[i] * opacity * light[i][c];
      share[i] *= 1.0F - opacity;
      if (share[i] > 0.0F) behind = static_cast<std::uint8_t>(behind | 1U << i);
    }
    if (behind != 0) tracer.cast_behind(behind, packet, reads);
    lanes = behind;
  }
  return sum;
}

/// A beam that was cast, with its texture reads.
TILEFLIGHT_WIDE_VECTORS void CameraRenderer::Impl::add_light(const TracedBeam& beam, int samples_along_axis,
                                                             TileLight& sum) const {
  const int n = samples_along_axis;
  const bool is_plain = !shader && !atmosphere;
  const SrgbTables& srgb = SrgbTables::get();
  SquaredColors8 squares;
  for (int k = 0; k < beam.size; ++k) {
    const TracedBeam::Block& block = beam.blocks[static_cast<std::size_t>(k)];
    const scene::RayPacket8& packet = beam.packets[static_cast<std::size_t>(k)];
    const BlockTextureReads& reads = beam.reads[static_cast<std::size_t>(k)];
    tracer.shade(block.valid, packet, reads, squares);
    const std::uint8_t blending = tracer.blending_lanes(block.valid, reads);
    if (is_plain && blending == 0) {
      for_each_lane(block, [&](int i, int x, int y) {
        Float4 light;
        decode_squared(srgb, squares[static_cast<std::size_t>(i)], light);
        (n == 1 ? sum.at(x, y) : sum.at(x / n, y / n)) += light;  // a division takes longer than all the rest
      });
      continue;
    }
    std::array<LinearRgb, 8> lanes = light_through_air(block.valid, packet, squares);
    if (blending != 0) {
      const std::array<LinearRgb, 8> blended = blend_layers(blending, packet, reads);
      for (std::size_t i = 0; i < lanes.size(); ++i) {
        if ((blending >> i & 1U) != 0) lanes[i] = blended[i];
      }
    }
    for_each_lane(block, [&](int i, int x, int y) {
      const LinearRgb& light = lanes[static_cast<std::size_t>(i)];
      sum.at(x / n, y / n) += Float4{light[0], light[1], light[2], 0.0F};
    });
  }
}

/// Adds the light of all moments, and hands on the middle one's central rays, if these are what is cast.
void CameraRenderer::Impl::add_light(const PixelRegion& tile, const LightMoments& moments, const CentralRays& wanted,
                                     TileLight& sum, ViewStatistics& view) const {
  const RayTable& table = rays->samples ? *rays->samples : rays->central;
  std::array<TracedBeam, BlockTracer::kMostMoments> beams;
  for (std::size_t first = 0; first < moments.all.size(); first += moments.at_once) {
    const std::size_t count = std::min(moments.at_once, moments.all.size() - first);
    for_each_beam(tile, table.samples_along_axis(), [&](int x0, int y0) {
      if (count == 1) {
        tracer.cast(table, x0, y0, moments.all[first], beams[0]);
      } else {
        tracer.cast_moments(table, x0, y0, moments.all.subspan(first, count), beams);
      }
      tracer.prefetch_shading(beams[0]);  // of the others nearly the same
      tracer.compute_texture_reads(std::span(beams).first(count));
      for (std::size_t k = 0; k < count; ++k) {
        add_light(beams[k], table.samples_along_axis(), sum);
        if (first + k == moments.middle() && !rays->samples) note_central(beams[k], table, wanted, view);
      }
    });
  }
}

CentralRays CameraRenderer::Impl::wanted(imaging::FloatImage& depth_m, const SurfaceVisitor& visitor) const {
  return {options.depth ? &depth_m : nullptr, visitor ? &visitor : nullptr, scene.first_placed_mesh()};
}

RenderedFrame CameraRenderer::Impl::render(std::span<const geometry::SE3> poses_of_rows,
                                           const SurfaceVisitor& visitor) const {
  const RowPoses poses(poses_of_rows, scene.anchor());
  tracer.prepare();
  RenderedFrame frame{imaging::RgbImage(width(), height()), empty_depth(), {}};
  const CentralRays central = wanted(frame.depth_m, visitor);
  frame.view = for_each_tile([&](const PixelRegion& tile) { return trace_central(tile, poses, central, &frame.rgb); });
  return frame;
}

LightFrame CameraRenderer::Impl::render_light(const ShutterPoses& shutter, const SurfaceVisitor& visitor,
                                              const LightSink& sink) const {
  LightFrame frame{sink ? LinearImage() : LinearImage(width(), height()), empty_depth(), {}};
  const LightSink keep = [&frame](int x, int y, std::span<const LinearRgb> light) {
    std::ranges::copy(light, &frame.light(x, y));
  };
  std::vector<RowPoses> moments;
  for (int k = 0; k < shutter.moments; ++k) moments.push_back(rows_at(shutter, k));
  tracer.prepare();
  const LightMoments all{moments, moments_at_once(moments)};
  const CentralRays central = wanted(frame.depth_m, visitor);
  const float scale = 1.0F / static_cast<float>(shutter.moments * options.samples_per_pixel);
  frame.view = for_each_tile([&](const PixelRegion& tile) {
    ViewStatistics view;
    TileLight sum(tile);
    add_light(tile, all, central, sum, view);
    sum.hand_over(scale, sink ? sink : keep);
    return rays->samples ? trace_central(tile, all.all[all.middle()], central, nullptr) : view;
  });
  return frame;
}

/// Moments of a global shutter are beams of one origin each, which cost less than what they would share.
std::size_t CameraRenderer::Impl::moments_at_once(std::span<const RowPoses> moments) const {
  return moments.front().has_single_pose() ? 1 : std::min(moments.size(), BlockTracer::kMostMoments);
}

CameraRenderer::CameraRenderer(const scene::Scene& scene, imaging::Camera camera, RenderOptions options)
    : CameraRenderer(scene, std::make_shared<const Appearance>(scene), std::move(camera), options) {}

CameraRenderer::CameraRenderer(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance,
                               imaging::Camera camera, RenderOptions options)
    : CameraRenderer(
          scene, std::move(appearance),
          std::make_shared<const CameraRays>(std::move(camera), samples_along_axis(options.samples_per_pixel)),
          options) {}

CameraRenderer::CameraRenderer(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance,
                               std::shared_ptr<const CameraRays> rays, RenderOptions options)
    : impl_(std::make_unique<Impl>(scene, std::move(appearance), std::move(rays), options)) {}

CameraRenderer::~CameraRenderer() = default;

const imaging::Camera& CameraRenderer::camera() const { return impl_->rays->camera; }
std::shared_ptr<const CameraRays> CameraRenderer::rays() const { return impl_->rays; }
const geometry::Vec3& CameraRenderer::anchor() const { return impl_->scene.anchor(); }
const RenderOptions& CameraRenderer::options() const { return impl_->options; }
std::shared_ptr<const Appearance> CameraRenderer::appearance() const { return impl_->appearance; }

RenderedFrame CameraRenderer::render(const geometry::SE3& T_local_camera, const SurfaceVisitor& visitor) const {
  return render_rows(std::span(&T_local_camera, 1), visitor);
}

RenderedFrame CameraRenderer::render_rows(std::span<const geometry::SE3> T_local_camera_of_row,
                                          const SurfaceVisitor& visitor) const {
  const std::size_t rows = T_local_camera_of_row.size();
  require_a_pose_a_row(rows, impl_->height());
  if (!impl_->rays->samples && !impl_->shader) return impl_->render(T_local_camera_of_row, visitor);
  ShutterPoses shutter{1, static_cast<int>(rows), {T_local_camera_of_row.begin(), T_local_camera_of_row.end()}};
  LightFrame light = impl_->render_light(shutter, visitor, {});
  RenderedFrame frame{imaging::RgbImage(impl_->width(), impl_->height()), std::move(light.depth_m), light.view};
  const SrgbTables& srgb = SrgbTables::get();
  tbb::parallel_for(0, impl_->height(), [&](int y) {
    for (int x = 0; x < frame.rgb.width; ++x) frame.rgb(x, y) = srgb.encode(light.light(x, y));
  });
  return frame;
}

LightFrame CameraRenderer::render_light(const ShutterPoses& poses, const SurfaceVisitor& visitor,
                                        const LightSink& sink) const {
  const auto wanted = static_cast<std::size_t>(poses.moments) * static_cast<std::size_t>(poses.rows);
  if (poses.moments < 1 || poses.T_local_camera.size() != wanted ||
      (!poses.scene_times.empty() && poses.scene_times.size() != wanted) ||
      (poses.rows != 1 && poses.rows != impl_->height())) {
    throw std::invalid_argument("ShutterPoses: times x (1 or height) poses are needed");
  }
  return impl_->render_light(poses, visitor, sink);
}

void CameraRenderer::visit_surface(std::span<const geometry::SE3> T_local_camera_of_row, const SurfaceVisitor& visitor,
                                   std::span<const float> scene_times) const {
  require_a_pose_a_row(T_local_camera_of_row.size(), impl_->height());
  if (!scene_times.empty() && scene_times.size() != T_local_camera_of_row.size())
    throw std::invalid_argument("one time of the scene a pose");
  const RowPoses poses(T_local_camera_of_row, impl_->scene.anchor(), scene_times);
  impl_->tracer.prepare();
  impl_->for_each_tile([&](const PixelRegion& tile) {
    return impl_->trace_central(tile, poses, {nullptr, &visitor, impl_->scene.first_placed_mesh()}, nullptr);
  });
}

}  // namespace tileflight::render
