"""What tests look at in the page of a report."""

import html.parser


class PageReader(html.parser.HTMLParser):
    """Collects tags, ids, attributes and text, and notes each element that is not closed where it should be."""

    VOID = {"meta", "link", "img", "br", "wbr", "hr"}

    def __init__(self, text):
        super().__init__()
        self.open, self.faults, self.tags, self.ids, self.attributes, self.text = [], [], [], [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.handle_startendtag(tag, attrs)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_endtag(self, tag):
        if self.open and self.open[-1] == tag:
            self.open.pop()
        else:
            self.faults.append(f"</{tag}> at {self.getpos()} in {self.open[-3:]}")

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.text += data
