#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

/// A colour with opacity, each 0 to 1, in the encoding of image pixels.
struct Ink {
  double red = 0, green = 0, blue = 0, opacity = 1;
};

Ink to_ink(const imaging::Rgb8& color, double opacity = 1.0);

struct Stroke {
  Ink ink;
  double width_px = 1.0;
  std::vector<double> dashes_px;  ///< lengths on, off, on, …; empty: solid
};

enum class TextAnchor { kStart, kMiddle, kEnd };

struct TextStyle {
  double size_px = 14.0;
  Ink ink;
  bool bold = false;
  TextAnchor anchor = TextAnchor::kStart;  ///< which point of the text lies at its position
  double rotation_rad = 0.0;               ///< clockwise about its position
  std::optional<Ink> halo;                 ///< outline behind the letters, for legibility on any background
};

/// Draws lines, shapes, images and text with antialiasing. Positions are in pixels right and down from the image's
/// upper left corner, so that the first pixel's centre is at (0.5, 0.5).
///
/// Uses Cairo, which is common in this field (libav depends on it); text in DejaVu Sans (fonts-dejavu-core), or
/// fontconfig's substitute. A built-in font would lack umlauts and the scripts of copyright notices and place names.
class Canvas {
 public:
  Canvas(int width, int height, const imaging::Rgb8& paper);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  int width() const;
  int height() const;

  /// Draws a line through the points; `closed`: back to the first one.
  void draw_line(const std::vector<geometry::Vec2>& points, const Stroke& stroke, bool closed = false);
  /// Fills the polygon (even-odd rule if its edges cross).
  void fill_polygon(const std::vector<geometry::Vec2>& points, const Ink& ink);
  void fill_rectangle(double x, double y, double width, double height, const Ink& ink);
  void fill_disc(const geometry::Vec2& center, double radius_px, const Ink& ink);
  /// Draws an image with its upper left corner at (x, y); unscaled and unfiltered at integer positions.
  void draw_image(double x, double y, const imaging::RgbImage& image);
  void draw_text(double x, double y, const std::string& words, const TextStyle& lettering);
  /// Returns the width of the text, pixels.
  double text_width(const std::string& words, const TextStyle& lettering) const;

  /// Restricts drawing to the rectangle until unclip().
  void clip(double x, double y, double width, double height);
  void unclip();

  imaging::RgbImage image() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::drawing
