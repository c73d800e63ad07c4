// SPDX-License-Identifier: Apache-2.0
// Names that other people's files give to tensors, joints, terms and elements. They come to stand in robot files,
// refusals and logs; one that could be read there as more than a name is refused where the file is read, by all
// readers.
//
// A name: 1 to 127 characters of ASCII: letters, digits, blanks within it and _ - + . / : ( ); no blank behind a colon.
#pragma once

#include <string>
#include <string_view>

namespace takt::config {

// Empty: it is a name. Otherwise half a sentence: which it is, what is wrong and how to correct it.
std::string why_no_name(std::string_view text);

}  // namespace takt::config
