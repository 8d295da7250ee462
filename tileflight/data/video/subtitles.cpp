#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/video/libav.h"
#include "tileflight/data/video/video.h"

namespace tileflight::video {

namespace {

bool is_text(const AVStream& stream) {
  const AVCodecID codec = stream.codecpar->codec_id;
  return stream.codecpar->codec_type == AVMEDIA_TYPE_SUBTITLE &&
         (codec == AV_CODEC_ID_MOV_TEXT || codec == AV_CODEC_ID_SUBRIP || codec == AV_CODEC_ID_TEXT);
}

/// MOV's text samples begin with their length, two bytes, the higher first, and may end with styles.
std::string_view sample_text(const AVPacket& packet, AVCodecID codec) {
  const std::string_view bytes(reinterpret_cast<const char*>(packet.data), static_cast<std::size_t>(packet.size));
  if (codec != AV_CODEC_ID_MOV_TEXT) return bytes;
  if (bytes.size() < 2) return {};
  const std::size_t length = static_cast<unsigned char>(bytes[0]) << 8U | static_cast<unsigned char>(bytes[1]);
  return bytes.substr(2, length);
}

std::string clock_text(double time_s) {
  const auto ms = static_cast<long long>(std::llround(1e3 * std::max(0.0, time_s)));
  char text[40];
  std::snprintf(text, sizeof text, "%02lld:%02lld:%02lld,%03lld", ms / 3'600'000, ms / 60'000 % 60, ms / 1000 % 60,
                ms % 1000);
  return text;
}

/// The time of the first frame on the file's clock.
double video_start_s(const AVFormatContext& input) {
  for (unsigned i = 0; i < input.nb_streams; ++i) {
    const AVStream& stream = *input.streams[i];
    if (stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO && stream.start_time != AV_NOPTS_VALUE)
      return static_cast<double>(stream.start_time) * av_q2d(stream.time_base);
  }
  return 0.0;
}

}  // namespace

std::string read_subtitles(const std::filesystem::path& file) {
  const libav::OpenInput input = libav::open_input(file);
  const AVStream* chosen = nullptr;
  for (unsigned i = 0; i < input->nb_streams && chosen == nullptr; ++i)
    if (is_text(*input->streams[i])) chosen = input->streams[i];
  std::string text;
  if (chosen == nullptr) return text;
  const double start_s = video_start_s(*input), unit_s = av_q2d(chosen->time_base);
  const libav::Owner<AVPacket> packet(av_packet_alloc());
  for (int number = 1; av_read_frame(input.get(), packet.get()) >= 0; av_packet_unref(packet.get())) {
    if (packet->stream_index != chosen->index || packet->pts == AV_NOPTS_VALUE) continue;
    const std::string_view line = base::trim(sample_text(*packet, chosen->codecpar->codec_id));
    if (line.empty()) continue;
    const double begin_s = static_cast<double>(packet->pts) * unit_s - start_s;
    const double end_s = begin_s + static_cast<double>(packet->duration) * unit_s;
    text += std::to_string(number++) + "\n" + clock_text(begin_s) + " --> " + clock_text(end_s) + "\n";
    text.append(line).append("\n\n");
    if (text.size() > base::kMaxLogBytes) throw InputError(file.string(), "has more than 1 GiB of subtitles");
  }
  return text;
}

}  // namespace tileflight::video
