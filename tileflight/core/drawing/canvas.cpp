#include "tileflight/core/drawing/canvas.h"

#include <cairo.h>
#include <fontconfig/fontconfig.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "tileflight/core/base/program.h"

namespace tileflight::drawing {
namespace {

using geometry::Vec2;

struct CairoDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};
using Surface = std::unique_ptr<cairo_surface_t, CairoDeleter>;

/// A colour in Cairo's RGB24: 32 bits a pixel, red in bits 16 to 23.
std::uint32_t packed(const imaging::Rgb8& color) {
  return static_cast<std::uint32_t>(color[0]) << 16U | static_cast<std::uint32_t>(color[1]) << 8U | color[2];
}

unsigned char* row_of(cairo_surface_t* surface, int y) {
  return cairo_image_surface_get_data(surface) +
         static_cast<std::ptrdiff_t>(y) * cairo_image_surface_get_stride(surface);
}

Surface surface_of(const imaging::RgbImage& image) {
  Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, image.width, image.height));
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS) throw std::runtime_error("canvas: out of memory");
  cairo_surface_flush(surface.get());
  for (int y = 0; y < image.height; ++y) {
    unsigned char* out = row_of(surface.get(), y);
    for (int x = 0; x < image.width; ++x) {
      const std::uint32_t pixel = packed(image(x, y));
      std::memcpy(out + 4 * static_cast<std::ptrdiff_t>(x), &pixel, sizeof pixel);
    }
  }
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

void set_color(cairo_t* context, const Ink& ink) {
  cairo_set_source_rgba(context, ink.red, ink.green, ink.blue, ink.opacity);
}

void trace_path(cairo_t* context, const std::vector<Vec2>& points) {
  cairo_new_path(context);
  for (const Vec2& p : points) cairo_line_to(context, p.x(), p.y());
}

/// Adds the fonts that lie beside the program, as in the archive and the Python package: a system may have none, and
/// no settings for fontconfig either.
void use_bundled_fonts() {
  const std::filesystem::path fonts = base::data_folder() / "fonts";
  if (!std::filesystem::is_directory(fonts)) return;
  if (!std::filesystem::exists("/etc/fonts/fonts.conf")) {
    FcConfig* const own = FcConfigCreate();
    FcConfigSetCurrent(own);  // keeps a reference
    FcConfigDestroy(own);
  }
  FcConfigAppFontAddDir(FcConfigGetCurrent(), reinterpret_cast<const FcChar8*>(fonts.c_str()));
}

/// Sets font options explicitly, so that text does not depend on the user's font settings.
void set_font(cairo_t* context, const TextStyle& lettering) {
  [[maybe_unused]] static const bool kHasFonts = (use_bundled_fonts(), true);
  cairo_select_font_face(context, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                         lettering.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context, lettering.size_px);
  const std::unique_ptr<cairo_font_options_t, CairoDeleter> options(cairo_font_options_create());
  cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  cairo_set_font_options(context, options.get());
}

double advance_px(cairo_t* context, const std::string& words) {
  cairo_text_extents_t extents;
  cairo_text_extents(context, words.c_str(), &extents);
  return extents.x_advance;
}

double anchor_fraction(TextAnchor anchor) {
  if (anchor == TextAnchor::kStart) return 0.0;
  return anchor == TextAnchor::kMiddle ? 0.5 : 1.0;
}

/// Cairo rejects text that is not valid UTF-8; invalid bytes are replaced by question marks.
std::string valid_utf8(const std::string& words) {
  std::string out;
  for (std::size_t i = 0; i < words.size();) {
    const auto lead = static_cast<unsigned char>(words[i]);
    const std::size_t length = lead < 0x80                   ? 1
                               : lead >= 0xC2 && lead < 0xE0 ? 2
                               : lead >= 0xE0 && lead < 0xF0 ? 3
                               : lead >= 0xF0 && lead < 0xF5 ? 4
                                                             : 0;
    bool whole = length > 0 && i + length <= words.size() && lead != 0;
    for (std::size_t k = 1; whole && k < length; ++k)
      whole = (static_cast<unsigned char>(words[i + k]) & 0xC0U) == 0x80;
    out += whole ? words.substr(i, length) : "?";
    i += whole ? length : 1;
  }
  return out;
}

}  // namespace

Ink to_ink(const imaging::Rgb8& color, double opacity) {
  return {color[0] / 255.0, color[1] / 255.0, color[2] / 255.0, opacity};
}

struct Canvas::Impl {
  Surface surface;
  std::unique_ptr<cairo_t, CairoDeleter> context;
};

Canvas::Canvas(int width, int height, const imaging::Rgb8& paper) : impl_(std::make_unique<Impl>()) {
  impl_->surface = surface_of(imaging::RgbImage(width, height, paper));
  impl_->context.reset(cairo_create(impl_->surface.get()));
  cairo_set_line_join(impl_->context.get(), CAIRO_LINE_JOIN_ROUND);
}

Canvas::~Canvas() = default;

int Canvas::width() const { return cairo_image_surface_get_width(impl_->surface.get()); }
int Canvas::height() const { return cairo_image_surface_get_height(impl_->surface.get()); }

void Canvas::draw_line(const std::vector<Vec2>& points, const Stroke& stroke, bool closed) {
  cairo_t* context = impl_->context.get();
  trace_path(context, points);
  if (closed) cairo_close_path(context);
  set_color(context, stroke.ink);
  cairo_set_line_width(context, stroke.width_px);
  cairo_set_dash(context, stroke.dashes_px.data(), static_cast<int>(stroke.dashes_px.size()), 0.0);
  cairo_stroke(context);
}

void Canvas::fill_polygon(const std::vector<Vec2>& points, const Ink& ink) {
  cairo_t* context = impl_->context.get();
  trace_path(context, points);
  set_color(context, ink);
  cairo_set_fill_rule(context, CAIRO_FILL_RULE_EVEN_ODD);
  cairo_fill(context);
}

void Canvas::fill_rectangle(double x, double y, double width, double height, const Ink& ink) {
  fill_polygon({{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}}, ink);
}

void Canvas::fill_disc(const Vec2& center, double radius_px, const Ink& ink) {
  cairo_t* context = impl_->context.get();
  cairo_new_path(context);
  constexpr double kWhole_rad = 6.283185307179586;
  cairo_arc(context, center.x(), center.y(), radius_px, 0.0, kWhole_rad);
  set_color(context, ink);
  cairo_fill(context);
}

void Canvas::draw_image(double x, double y, const imaging::RgbImage& image) {
  if (image.empty()) return;
  cairo_t* context = impl_->context.get();
  const Surface surface = surface_of(image);
  cairo_set_source_surface(context, surface.get(), x, y);
  cairo_new_path(context);
  cairo_rectangle(context, x, y, image.width, image.height);
  cairo_fill(context);
}

void Canvas::draw_text(double x, double y, const std::string& words, const TextStyle& lettering) {
  cairo_t* context = impl_->context.get();
  const std::string shown = valid_utf8(words);
  set_font(context, lettering);
  cairo_save(context);
  cairo_translate(context, x, y);
  cairo_rotate(context, lettering.rotation_rad);
  cairo_new_path(context);
  cairo_move_to(context, -anchor_fraction(lettering.anchor) * advance_px(context, shown), 0.0);
  cairo_text_path(context, shown.c_str());
  if (lettering.halo) {
    set_color(context, *lettering.halo);
    cairo_set_dash(context, nullptr, 0, 0.0);
    cairo_set_line_width(context, 0.28 * lettering.size_px);
    cairo_stroke_preserve(context);
  }
  set_color(context, lettering.ink);
  cairo_set_fill_rule(context, CAIRO_FILL_RULE_WINDING);
  cairo_fill(context);
  cairo_restore(context);
}

double Canvas::text_width(const std::string& words, const TextStyle& lettering) const {
  set_font(impl_->context.get(), lettering);
  return advance_px(impl_->context.get(), valid_utf8(words));
}

void Canvas::clip(double x, double y, double width, double height) {
  cairo_t* context = impl_->context.get();
  cairo_new_path(context);
  cairo_rectangle(context, x, y, width, height);
  cairo_clip(context);
}

void Canvas::unclip() { cairo_reset_clip(impl_->context.get()); }

imaging::RgbImage Canvas::image() const {
  cairo_surface_flush(impl_->surface.get());
  imaging::RgbImage image(width(), height());
  for (int y = 0; y < image.height; ++y) {
    const unsigned char* in = row_of(impl_->surface.get(), y);
    for (int x = 0; x < image.width; ++x) {
      std::uint32_t pixel = 0;
      std::memcpy(&pixel, in + 4 * static_cast<std::ptrdiff_t>(x), sizeof pixel);
      image(x, y) = {static_cast<std::uint8_t>(pixel >> 16U), static_cast<std::uint8_t>(pixel >> 8U),
                     static_cast<std::uint8_t>(pixel)};
    }
  }
  return image;
}

}  // namespace tileflight::drawing
