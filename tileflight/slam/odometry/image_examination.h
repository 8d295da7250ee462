#pragma once

// Measures on the images alone why a flight cannot be tracked: their grey values, their order, cuts, and what stands
// still in them.

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::odometry {

/// Reads the image at a position of the flight; nullopt if it cannot be decoded. Called from several threads.
using ImageReader = std::function<std::optional<imaging::GrayImage>(std::size_t index)>;

/// Holds what the examination keeps of an image.
struct ImageSummary {
  bool readable = false;
  int smallest = 0, largest = 0;  ///< grey values without the extreme thousandth of the pixels
  double deviation = 0.0;         ///< standard deviation of `thumbnail`, grey values
  std::vector<float> thumbnail;   ///< 32 x 18 means of the image's parts, grey values
};

/// Summarizes `count` images.
std::vector<ImageSummary> summarize_images(std::size_t count, const ImageReader& read);

/// Returns the positions of the images that follow a cut: the image before shows something else, although the images
/// around change little, and it does not come back within a second. Blank images are no cuts.
std::vector<std::size_t> find_cuts(const std::vector<ImageSummary>& images);

/// Consecutive images in which nothing can be tracked.
struct BlankImages {
  std::size_t first = 0, last = 0;
  std::string look;  ///< "nearly black", "nearly white" or "without contrast"
};

/// Returns them in the order of the images.
std::vector<BlankImages> find_blank_images(const std::vector<ImageSummary>& images);

/// A cause and its remedy, one sentence each.
struct ImageFault {
  std::string cause;
  std::string remedy;
};

/// Returns what is wrong with the images' grey values or order; nullopt: nothing is known. `name_of`: the name of the
/// image at a position.
std::optional<ImageFault> find_image_fault(const std::vector<ImageSummary>& images,
                                           const std::function<std::string(std::size_t)>& name_of);

/// Returns the share of an image that a mask covers: of its pixels with 0, 0 to 1.
double masked_share(const imaging::GrayImage& mask);

/// Returns a mask with 0 where edges stand still throughout the flight while the rest of the image changes (text,
/// logos, the vehicle), with a margin; empty if there are none, or if most of the image stands still. Edges where
/// `known` is 0 do not count, and keep 255; empty: all count.
imaging::GrayImage find_static_pixels(std::size_t count, const ImageReader& read, const imaging::GrayImage& known = {});

}  // namespace tileflight::odometry
