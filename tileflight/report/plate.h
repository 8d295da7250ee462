#pragma once

#include <string>
#include <vector>

#include "tileflight/imaging/canvas.h"

// What figures that are drawn as pixels have in common: inks, letters, axes. Those of the page are SVG (drawing.h); a
// picture file that any viewer opens cannot be, and nothing here turns SVG into pixels.
namespace tileflight::report::plate {

inline constexpr imaging::Rgb8 kPaper{255, 255, 255};
inline constexpr imaging::Ink kInk{0.12, 0.13, 0.15, 1.0};
inline constexpr imaging::Ink kQuiet{0.42, 0.44, 0.47, 1.0};
inline constexpr imaging::Ink kRule{0.83, 0.84, 0.86, 1.0};
inline constexpr imaging::Ink kWarning{0.80, 0.09, 0.11, 1.0};
inline constexpr imaging::Ink kHalo{1.0, 1.0, 1.0, 0.85};

/// Letters of figures: for axes and notes, for a title, for what is written on a picture.
imaging::Lettering words(double size_px = 14.0);
imaging::Lettering quiet(double size_px = 13.0);
imaging::Lettering title();
imaging::Lettering on_picture(double size_px = 14.0);

/// Where values of an axis lie on the canvas.
struct Scale {
  double low = 0.0, high = 1.0;        ///< values
  double low_px = 0.0, high_px = 1.0;  ///< where they lie: to the right, or (high_px below low_px) upwards

  double at(double value) const { return low_px + (value - low) / (high - low) * (high_px - low_px); }
};

/// Marks at a frame's side, with their texts outside it.
struct Tick {
  double at_px = 0.0;
  std::string text;
};
std::vector<Tick> ticks_of(const Scale& scale, int wanted);
enum class Side { kBottom, kLeft, kTop, kRight };
/// A rectangle, in pixels.
struct Frame {
  double x = 0, y = 0, width = 0, height = 0;
  double right() const { return x + width; }
  double bottom() const { return y + height; }
};
/// `label` stands beyond the ticks' texts; empty: none. Texts that would touch the one before are left out.
void draw_axis(imaging::Canvas& canvas, const Frame& frame, Side side, const std::vector<Tick>& ticks,
               const std::string& label);
void draw_border(imaging::Canvas& canvas, const Frame& frame);

/// As much of the words as fits, with an ellipsis where some are cut.
std::string fitted(const imaging::Canvas& canvas, const std::string& text, const imaging::Lettering& lettering,
                   double width_px);
/// Words on as many lines as they take.
std::vector<std::string> wrapped(const imaging::Canvas& canvas, const std::string& text,
                                 const imaging::Lettering& lettering, double width_px);

}  // namespace tileflight::report::plate
