#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/image.h"

namespace tileflight::imaging {

/// A colour with opacity, each from 0 to 1, encoded as pixels are.
struct Ink {
  double red = 0, green = 0, blue = 0, opacity = 1;
};

Ink ink_of(const Rgb8& color, double opacity = 1.0);

struct Stroke {
  Ink ink;
  double width_px = 1.0;
  std::vector<double> dashes_px;  ///< on, off, on, …; empty: unbroken
};

enum class Anchor { kStart, kMiddle, kEnd };

struct Lettering {
  double size_px = 14.0;
  Ink ink;
  bool bold = false;
  Anchor anchor = Anchor::kStart;  ///< which end of the line of text stands at its place
  double turned_rad = 0.0;         ///< clockwise about its place
  std::optional<Ink> halo;         ///< behind the letters, so that they are read on any ground
};

/// Where figures are drawn as pixels: lines, shapes, pictures and text, smooth at their edges. Places are in pixels
/// right and down from the image's upper left corner, so that the first pixel's centre is at (0.5, 0.5).
///
/// Drawn by Cairo, the library of this kind that the field's programs share (libav brings it along); text in DejaVu
/// Sans (fonts-dejavu-core), or what fontconfig has in its place. A font of our own would know neither the umlauts nor
/// the scripts that copyrights and names of places are written in.
class Canvas {
 public:
  Canvas(int width, int height, const Rgb8& paper);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  int width() const;
  int height() const;

  /// Through the points; `closed`: back to the first one.
  void line(const std::vector<geometry::Vec2>& points, const Stroke& stroke, bool closed = false);
  /// The area within the polygon (where its lines cross, by the even-odd rule).
  void fill(const std::vector<geometry::Vec2>& points, const Ink& ink);
  void rectangle(double x, double y, double width, double height, const Ink& ink);
  void disc(const geometry::Vec2& center, double radius_px, const Ink& ink);
  /// A picture with its upper left corner at (x, y), pixel on pixel where these are whole numbers.
  void picture(double x, double y, const RgbImage& image);
  void text(double x, double y, const std::string& words, const Lettering& lettering);
  /// How wide the words become.
  double text_width(const std::string& words, const Lettering& lettering) const;

  /// What is drawn from here on is seen within the rectangle only, until unclip().
  void clip(double x, double y, double width, double height);
  void unclip();

  RgbImage image() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::imaging
