#pragma once

#include <string>
#include <vector>

#include "tileflight/core/drawing/canvas.h"

// Common parts of figures drawn as pixels: colours, text styles, axes. The page's figures are SVG (drawing.h); these
// are for image files, which this program cannot create from SVG.
namespace tileflight::drawing::plate {

inline constexpr imaging::Rgb8 kBackground{255, 255, 255};
inline constexpr Ink kInk{0.12, 0.13, 0.15, 1.0};
inline constexpr Ink kMuted{0.42, 0.44, 0.47, 1.0};
inline constexpr Ink kGridline{0.83, 0.84, 0.86, 1.0};
inline constexpr Ink kWarning{0.80, 0.09, 0.11, 1.0};
inline constexpr Ink kHalo{1.0, 1.0, 1.0, 0.85};

/// Text styles: axes and notes, less important text, titles, and text over images.
TextStyle body_lettering(double size_px = 14.0);
TextStyle muted_lettering(double size_px = 13.0);
TextStyle title_lettering();
TextStyle overlay_lettering(double size_px = 14.0);

/// Mapping from the values of an axis to canvas pixels.
struct AxisScale {
  double low = 0.0, high = 1.0;        ///< values
  double low_px = 0.0, high_px = 1.0;  ///< their positions: left to right, or (high_px below low_px) upwards

  double to_px(double value) const { return low_px + (value - low) / (high - low) * (high_px - low_px); }
};

/// A tick mark at a side of the plot area, with its label outside.
struct Tick {
  double at_px = 0.0;
  std::string text;
};
/// Makes about `count` ticks at round values of the axis.
std::vector<Tick> make_ticks(const AxisScale& scale, int count);
enum class Side { kBottom, kLeft, kTop, kRight };
/// A rectangle, in pixels.
struct PlotArea {
  double x = 0, y = 0, width = 0, height = 0;
  double right() const { return x + width; }
  double bottom() const { return y + height; }
};
/// Draws ticks and their labels, with the axis `label` (may be empty) outside of them. Tick labels that would touch the
/// one before are left out.
void draw_axis(Canvas& canvas, const PlotArea& frame, Side side, const std::vector<Tick>& ticks,
               const std::string& label);
/// Draws the border of the plot area.
void draw_border(Canvas& canvas, const PlotArea& frame);

/// Shortens the text to fit the width, with an ellipsis if it was cut.
std::string truncate_to_width(const Canvas& canvas, const std::string& text, const TextStyle& lettering,
                              double width_px);

}  // namespace tileflight::drawing::plate
