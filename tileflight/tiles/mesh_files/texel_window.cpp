#include "tileflight/tiles/mesh_files/texel_window.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace tileflight::mesh_files {
namespace {

using imaging::Wrap;

std::int64_t wrapped(std::int64_t at, std::int64_t size, Wrap wrap) {
  if (at >= 0 && at < size) return at;
  if (wrap == Wrap::kClampToEdge) return std::clamp<std::int64_t>(at, 0, size - 1);
  const std::int64_t period = wrap == Wrap::kRepeat ? size : 2 * size;
  const std::int64_t within = (at % period + period) % period;
  return within < size ? within : period - 1 - within;
}

/// Texels of `from` sampled for pixel `i` of `to` along an axis: at most eight, evenly spread.
struct Samples {
  std::array<std::int64_t, 8> at{};
  int count = 0;
};

Samples samples_of(std::int64_t i, std::int64_t to, std::int64_t from) {
  const std::int64_t begin = i * from / to, end = std::max(begin + 1, (i + 1) * from / to);
  Samples out;
  out.count = static_cast<int>(std::min<std::int64_t>(8, end - begin));
  for (int k = 0; k < out.count; ++k)
    out.at[static_cast<std::size_t>(k)] = begin + (2 * k + 1) * (end - begin) / (2 * out.count);
  return out;
}

imaging::Rgb8 fetch_wrapped(const imaging::TexturedMesh& mesh, const TexelFetcher& fetch, std::int64_t x,
                            std::int64_t y) {
  const imaging::RgbImage& image = *mesh.texture;
  return fetch(image, static_cast<int>(wrapped(x, image.width, mesh.wrap_u)),
               static_cast<int>(wrapped(y, image.height, mesh.wrap_v)));
}

imaging::Rgb8 mean(const imaging::TexturedMesh& mesh, const TexelFetcher& fetch, const TexelWindow& window,
                   const Samples& across, const Samples& down) {
  std::array<int, 3> sum{};
  for (int j = 0; j < down.count; ++j)
    for (int i = 0; i < across.count; ++i) {
      const imaging::Rgb8 texel = fetch_wrapped(mesh, fetch, window.x + across.at[static_cast<std::size_t>(i)],
                                                window.y + down.at[static_cast<std::size_t>(j)]);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += texel[c];
    }
  const int count = across.count * down.count;
  imaging::Rgb8 out{};
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
  return out;
}

}  // namespace

TexelWindow bounding_window(const TexelWindow& a, const TexelWindow& b) {
  TexelWindow out{std::min(a.x, b.x), std::min(a.y, b.y), 0, 0};
  out.width = std::max(a.x + a.width, b.x + b.width) - out.x;
  out.height = std::max(a.y + a.height, b.y + b.height) - out.y;
  return out;
}

MergedWindows merge_overlapping(const std::vector<TexelWindow>& windows) {
  std::vector<std::size_t> order(windows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return windows[a].x < windows[b].x; });
  MergedWindows out;
  out.merged_index.resize(windows.size());
  // Windows are sorted from left to right; those that end before the next one begins cannot grow any more.
  std::vector<std::size_t> open;
  for (const std::size_t i : order) {
    const TexelWindow& next = windows[i];
    std::erase_if(open, [&](std::size_t w) { return out.windows[w].x + out.windows[w].width <= next.x; });
    const auto joinable = std::find_if(open.begin(), open.end(), [&](std::size_t w) {
      return bounding_window(out.windows[w], next).area() <= out.windows[w].area() + next.area();
    });
    if (joinable == open.end()) {
      open.push_back(out.windows.size());
      out.merged_index[i] = out.windows.size();
      out.windows.push_back(next);
    } else {
      out.windows[*joinable] = bounding_window(out.windows[*joinable], next);
      out.merged_index[i] = *joinable;
    }
  }
  return out;
}

imaging::Rgb8 wrapped_texel(const imaging::TexturedMesh& mesh, std::int64_t x, std::int64_t y) {
  const imaging::RgbImage& image = *mesh.texture;
  return image(static_cast<int>(wrapped(x, image.width, mesh.wrap_u)),
               static_cast<int>(wrapped(y, image.height, mesh.wrap_v)));
}

TexelFetcher fetch_from_memory() {
  return [](const imaging::RgbImage& image, int x, int y) { return image(x, y); };
}

void draw_window(const imaging::TexturedMesh& mesh, const TexelFetcher& fetch, const TexelWindow& window,
                 imaging::PixelPosition at, imaging::PixelSize size, imaging::RgbImage& sheet) {
  const bool as_it_is = size.width == window.width && size.height == window.height;
  for (int y = 0; y < size.height; ++y) {
    imaging::Rgb8* row = sheet.row(at.y + y) + at.x;
    const Samples down = samples_of(y, size.height, window.height);
    for (int x = 0; x < size.width; ++x)
      row[x] = as_it_is ? fetch_wrapped(mesh, fetch, window.x + x, window.y + y)
                        : mean(mesh, fetch, window, samples_of(x, size.width, window.width), down);
  }
}

}  // namespace tileflight::mesh_files
