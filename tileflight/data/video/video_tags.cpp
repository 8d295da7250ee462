#include "tileflight/data/video/video_tags.h"

#include "tileflight/data/video/libav.h"

namespace tileflight::video {

std::map<std::string, std::string> read_video_tags(const std::filesystem::path& file) {
  const libav::OpenInput input = libav::open_input(file);
  const int track = av_find_best_stream(input.get(), AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (track < 0) throw InputError(file.string(), "has no video track");
  std::map<std::string, std::string> tags;
  for (const AVDictionary* metadata : {input->streams[track]->metadata, input->metadata}) {
    const AVDictionaryEntry* tag = nullptr;
    while ((tag = av_dict_get(metadata, "", tag, AV_DICT_IGNORE_SUFFIX)) != nullptr)
      tags.insert_or_assign(tag->key, tag->value);
  }
  return tags;
}

}  // namespace tileflight::video
