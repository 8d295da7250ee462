#include "tileflight/slam/odometry/image_examination.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>

namespace tileflight::odometry {
namespace {

constexpr int kThumbWidth = 32, kThumbHeight = 18;

ImageSummary summarize(const imaging::GrayImage& image) {
  ImageSummary summary;
  summary.readable = true;
  std::array<std::size_t, 256> histogram{};
  for (const std::uint8_t value : image.pixels) ++histogram[value];
  const std::size_t extreme = image.pixels.size() / 1000;
  std::size_t below = 0, above = 0;
  for (summary.smallest = 0; summary.smallest < 255; ++summary.smallest) {
    below += histogram[static_cast<std::size_t>(summary.smallest)];
    if (below > extreme) break;
  }
  for (summary.largest = 255; summary.largest > 0; --summary.largest) {
    above += histogram[static_cast<std::size_t>(summary.largest)];
    if (above > extreme) break;
  }
  double sum = 0.0, squares = 0.0;
  for (int v = 0; v < kThumbHeight; ++v) {
    const int y0 = v * image.height / kThumbHeight, y1 = std::max(y0 + 1, (v + 1) * image.height / kThumbHeight);
    for (int u = 0; u < kThumbWidth; ++u) {
      const int x0 = u * image.width / kThumbWidth, x1 = std::max(x0 + 1, (u + 1) * image.width / kThumbWidth);
      std::int64_t total = 0;
      for (int y = y0; y < std::min(y1, image.height); ++y)
        for (int x = x0; x < std::min(x1, image.width); ++x) total += image(x, y);
      const double mean = static_cast<double>(total) / ((y1 - y0) * (x1 - x0));
      summary.thumbnail.push_back(static_cast<float>(mean));
      sum += mean;
      squares += mean * mean;
    }
  }
  const double n = kThumbWidth * kThumbHeight;
  summary.deviation = std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
  return summary;
}

/// Normalised correlation where `b` is moved by (dx, dy) over `a`.
double correlation(const ImageSummary& a, const ImageSummary& b, int dx, int dy) {
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  for (int y = std::max(0, dy); y < std::min(kThumbHeight, kThumbHeight + dy); ++y) {
    for (int x = std::max(0, dx); x < std::min(kThumbWidth, kThumbWidth + dx); ++x) {
      const double p = a.thumbnail[static_cast<std::size_t>(y * kThumbWidth + x)];
      const double q = b.thumbnail[static_cast<std::size_t>((y - dy) * kThumbWidth + x - dx)];
      n += 1, sa += p, sb += q, saa += p * p, sbb += q * q, sab += p * q;
    }
  }
  const double scale = std::sqrt(std::max(0.0, saa - sa * sa / n) * std::max(0.0, sbb - sb * sb / n));
  return scale > 1e-6 ? (sab - sa * sb / n) / scale : 0.0;
}

// Grey values, chosen by hand.
constexpr int kNearlyBlack = 30, kNearlyWhite = 225, kFlat = 12;

enum class Look { kTextured, kBlack, kWhite, kFlat };

Look look_of(const ImageSummary& image) {
  if (!image.readable) return Look::kTextured;
  if (image.largest < kNearlyBlack) return Look::kBlack;
  if (image.smallest > kNearlyWhite) return Look::kWhite;
  return image.largest - image.smallest < kFlat ? Look::kFlat : Look::kTextured;
}

const char* text_of(Look look) {
  return look == Look::kBlack ? "nearly black" : look == Look::kWhite ? "nearly white" : "without contrast";
}

/// Images with too little contrast to be compared.
bool is_blank(const ImageSummary& image) {
  constexpr double kDeviation = 3.0;  // grey values; chosen by hand
  return !image.readable || image.deviation < kDeviation;
}

/// Difference of two images, 0 to 2, without regard to where in the image things are, within a quarter of it.
double difference(const ImageSummary& a, const ImageSummary& b) {
  constexpr int kReachX = kThumbWidth / 4, kReachY = kThumbHeight / 4;
  double best = -1.0;
  for (int dy = -kReachY; dy <= kReachY; ++dy)
    for (int dx = -kReachX; dx <= kReachX; ++dx) best = std::max(best, correlation(a, b, dx, dy));
  return 1.0 - best;
}

/// Positions of the images that can be compared.
std::vector<std::size_t> comparable(const std::vector<ImageSummary>& images) {
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < images.size(); ++i)
    if (!is_blank(images[i])) positions.push_back(i);
  return positions;
}

/// Whether one of the images after a change is as the image before it: something was in front of the lens for a while.
bool comes_back(const std::vector<ImageSummary>& images, std::size_t before, double change) {
  constexpr std::size_t kWhile = 31;
  constexpr double kSame = 0.4;  // of the change; chosen by hand
  for (std::size_t i = before + 2; i < std::min(images.size(), before + 1 + kWhile); ++i)
    if (!is_blank(images[i]) && difference(images[before], images[i]) < kSame * change) return true;
  return false;
}

/// Where images follow that continue at another place of the sequence. Empty: the order is right, as far as can be
/// seen.
std::vector<std::pair<std::size_t, std::size_t>> find_continuations(const std::vector<ImageSummary>& images) {
  constexpr std::size_t kMost = 1500;  // images; the comparison of all with all takes their square
  const std::vector<std::size_t> at = comparable(images);
  if (at.size() < 4 || at.size() > kMost) return {};
  const auto apart = [&](std::size_t a, std::size_t b) {
    return 1.0 - correlation(images[at[a]], images[at[b]], 0, 0);
  };
  std::vector<double> nearest(at.size());
  tbb::parallel_for(std::size_t{0}, at.size(), [&](std::size_t i) {
    double least = 2.0;
    for (std::size_t j = 0; j < at.size(); ++j)
      if (j != i) least = std::min(least, apart(i, j));
    nearest[i] = least;
  });
  std::nth_element(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2), nearest.end());
  const double usual = nearest[nearest.size() / 2];
  const double far = std::max(3.0 * usual, 0.06), near = 1.5 * usual + 0.01;  // chosen by hand
  std::vector<std::size_t> ends, begins{0};
  for (std::size_t i = 0; i + 1 < at.size(); ++i) {
    if (apart(i, i + 1) <= far) continue;
    ends.push_back(i);
    begins.push_back(i + 1);
  }
  std::vector<std::pair<std::size_t, std::size_t>> found;
  for (const std::size_t end : ends) {
    const auto next = std::ranges::min_element(
        begins, {}, [&](std::size_t begin) { return begin == end + 1 || begin == end ? 2.0 : apart(end, begin); });
    if (*next != end + 1 && *next != end && apart(end, *next) <= near) found.emplace_back(at[end], at[*next]);
  }
  return found;
}

/// Grows regions of zeros by `reach` pixels.
imaging::GrayImage grown(const imaging::GrayImage& mask, int reach) {
  imaging::GrayImage out(mask.width, mask.height, 255);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (mask(x, y) != 0) continue;
      for (int yy = std::max(0, y - reach); yy <= std::min(mask.height - 1, y + reach); ++yy)
        for (int xx = std::max(0, x - reach); xx <= std::min(mask.width - 1, x + reach); ++xx) out(xx, yy) = 0;
    }
  }
  return out;
}

}  // namespace

double masked_share(const imaging::GrayImage& mask) {
  return static_cast<double>(std::ranges::count(mask.pixels, std::uint8_t{0})) /
         static_cast<double>(std::max<std::size_t>(1, mask.pixels.size()));
}

std::vector<ImageSummary> summarize_images(std::size_t count, const ImageReader& read) {
  std::vector<ImageSummary> images(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    if (const std::optional<imaging::GrayImage> image = read(i)) images[i] = summarize(*image);
  });
  return images;
}

std::vector<std::size_t> find_cuts(const std::vector<ImageSummary>& images) {
  // Difference from which on an image shows something else, and the share of it by which the images around may change.
  // Two flights under the same sky differ by 0.4; within four real flights, images differ by at most 0.04.
  constexpr double kOther = 0.15, kCalm = 0.25;
  constexpr std::size_t kAround = 5;
  if (images.size() < 2) return {};
  std::vector<double> changes(images.size() - 1);
  tbb::parallel_for(std::size_t{0}, changes.size(), [&](std::size_t i) {
    changes[i] = is_blank(images[i]) || is_blank(images[i + 1]) ? 0.0 : difference(images[i], images[i + 1]);
  });
  std::vector<std::size_t> cuts;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    if (changes[i] < kOther) continue;
    std::vector<double> around;
    for (std::size_t k = i - std::min(i, kAround); k < std::min(changes.size(), i + kAround + 1); ++k)
      if (k != i) around.push_back(changes[k]);
    if (around.size() < kAround) continue;
    std::ranges::sort(around);
    const bool is_calm = around[around.size() * 3 / 4] < kCalm * changes[i];
    if (is_calm && !comes_back(images, i, changes[i])) cuts.push_back(i + 1);
  }
  return cuts;
}

std::vector<BlankImages> find_blank_images(const std::vector<ImageSummary>& images) {
  std::vector<BlankImages> runs;
  Look before = Look::kTextured;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Look look = look_of(images[i]);
    if (look != Look::kTextured && look == before)
      runs.back().last = i;
    else if (look != Look::kTextured)
      runs.push_back({i, i, text_of(look)});
    before = look;
  }
  return runs;
}

std::optional<ImageFault> find_image_fault(const std::vector<ImageSummary>& images,
                                           const std::function<std::string(std::size_t)>& name_of) {
  constexpr double kMost = 0.5;  // share of the images from which on a fault explains that there is no map; by hand
  int largest = 0, smallest = 255;
  std::size_t readable = 0, black = 0, white = 0, flat = 0;
  for (const ImageSummary& image : images) {
    if (!image.readable) continue;
    ++readable;
    largest = std::max(largest, image.largest);
    smallest = std::min(smallest, image.smallest);
    const Look look = look_of(image);
    black += look == Look::kBlack ? 1 : 0;
    white += look == Look::kWhite ? 1 : 0;
    flat += look == Look::kFlat ? 1 : 0;
  }
  if (readable == 0) return std::nullopt;
  const auto concerns_most = [&](std::size_t n) {
    return static_cast<double>(n) > kMost * static_cast<double>(readable);
  };
  const auto which = [&](std::size_t n) {
    return n == readable ? std::string("the images are")
                         : std::to_string(n) + " of " + std::to_string(readable) + " images are";
  };
  const auto value = [&](std::size_t n, const std::string& text) {
    return n == readable ? " (" + text + " of 255)" : std::string();
  };
  if (concerns_most(black))
    return ImageFault{which(black) + " nearly black" + value(black, "largest value " + std::to_string(largest)),
                      "expose them longer, or leave them out (--from, --to); scale files that hold 10 or 12 bits in 16 "
                      "to the full range"};
  if (concerns_most(white))
    return ImageFault{which(white) + " nearly white" + value(white, "smallest value " + std::to_string(smallest)),
                      "expose them shorter, or leave them out (--from, --to)"};
  if (concerns_most(flat))
    return ImageFault{which(flat) + " without contrast: grey values within each differ by less than " +
                          std::to_string(kFlat) + " of 255",
                      "look at the images: fog, a covered lens or a wrong conversion; leave them out (--from, --to)"};
  const std::vector<std::pair<std::size_t, std::size_t>> continuations = find_continuations(images);
  if (continuations.size() >= 2) {
    const auto& [end, begin] = continuations.front();
    return ImageFault{"the images are not in the order in which they were taken: frame " + name_of(end) +
                          " continues in frame " + name_of(begin) + ", and " +
                          std::to_string(continuations.size() - 1) + " more do so elsewhere",
                      "name the files so that their order is that of time (frame_0001, frame_0002), or give times.txt"};
  }
  return std::nullopt;
}

imaging::GrayImage find_static_pixels(std::size_t count, const ImageReader& read, const imaging::GrayImage& known) {
  constexpr std::size_t kSamples = 16, kLeast = 8;
  constexpr int kStill = 14, kChanges = 20;  // spread over time, grey values: of what stands still, and of a quarter of
                                             // the pixels
  constexpr int kEdge = 40;                  // change over two pixels of an edge, grey values
  constexpr double kLeastShare = 0.001, kMostShare = 0.6;  // of the image. All chosen by hand
  if (count < kLeast) return {};
  const std::size_t samples = std::min(kSamples, count);
  std::vector<std::optional<imaging::GrayImage>> read_images(samples);
  tbb::parallel_for(std::size_t{0}, samples,
                    [&](std::size_t i) { read_images[i] = read(i * (count - 1) / (samples - 1)); });
  std::vector<const imaging::GrayImage*> images;
  for (const auto& image : read_images) {
    if (image && (images.empty() || (image->width == images.front()->width && image->height == images.front()->height)))
      images.push_back(&*image);
  }
  if (images.size() < kLeast) return {};
  const int width = images.front()->width, height = images.front()->height;
  imaging::GrayImage middle(width, height, 0), spread(width, height, 0);
  tbb::parallel_for(0, height, [&](int y) {
    std::vector<std::uint8_t> values(images.size());
    for (int x = 0; x < width; ++x) {
      for (std::size_t i = 0; i < images.size(); ++i) values[i] = (*images[i])(x, y);
      std::ranges::sort(values);
      const std::size_t out = values.size() / 8;  // a few images may differ
      middle(x, y) = values[values.size() / 2];
      spread(x, y) = static_cast<std::uint8_t>(values[values.size() - 1 - out] - values[out]);
    }
  });
  std::vector<std::uint8_t> sorted = spread.pixels;
  const std::size_t quarter = 3 * sorted.size() / 4;
  std::ranges::nth_element(sorted, sorted.begin() + static_cast<std::ptrdiff_t>(quarter));
  if (sorted[quarter] < kChanges) return {};  // the camera hardly moved
  const auto is_known = [&](int x, int y) { return !known.empty() && known(x, y) == 0; };
  if (!known.empty() && (known.width != width || known.height != height)) return {};
  imaging::GrayImage mask(width, height, 255);
  for (int y = 1; y + 1 < height; ++y) {
    for (int x = 1; x + 1 < width; ++x) {
      if (spread(x, y) > kStill || is_known(x, y)) continue;
      const int across = std::abs(middle(x + 1, y) - middle(x - 1, y)),
                down = std::abs(middle(x, y + 1) - middle(x, y - 1));
      if (std::max(across, down) >= kEdge) mask(x, y) = 0;
    }
  }
  if (masked_share(mask) < kLeastShare) return {};
  mask = grown(mask, std::max(3, width / 100));
  if (masked_share(mask) > kMostShare) return {};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (is_known(x, y)) mask(x, y) = 255;
  return mask;
}

}  // namespace tileflight::odometry
