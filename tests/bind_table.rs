//! The bind table of ARCHITECTURE.md is what the shaders say. Oracle: reflection by naga.

use tumble_gpu::Shader;
use wgpu::BufferBindingType;

const BEGIN: &str = "<!-- bind table -->\n";
const END: &str = "<!-- end of bind table -->";

fn table() -> String {
    let mut text = String::from("| pass | buffers |\n|---|---|\n");
    for (stem, _) in tumble_shaders::SOURCES {
        let composed = tumble_shaders::compose(stem).expect("it composes");
        let shader = Shader::parse(&composed).expect("it is valid");
        for entry in shader.entries() {
            let bindings = shader.bindings(entry).expect("it binds buffers only");
            let storage = bindings.iter().filter(|b| b.ty != BufferBindingType::Uniform).count();
            assert!(storage <= 8, "{stem}:{entry} binds {storage} storage buffers; the default limit is 8");
            let names: Vec<_> = bindings
                .iter()
                .map(|b| match b.ty {
                    BufferBindingType::Uniform => format!("{} u", b.name),
                    BufferBindingType::Storage { read_only: true } => format!("{} r", b.name),
                    BufferBindingType::Storage { read_only: false } => format!("{} rw", b.name),
                })
                .collect();
            text += &format!("| `{stem}:{entry}` | {} |\n", names.join(", "));
        }
    }
    text
}

#[test]
fn architecture_shows_the_bindings() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/ARCHITECTURE.md");
    let document = std::fs::read_to_string(path).expect("ARCHITECTURE.md");
    let begin = document.find(BEGIN).expect("the table's first mark") + BEGIN.len();
    let end = document.find(END).expect("the table's last mark");
    let table = table();
    if std::env::var_os("UPDATE_BIND_TABLE").is_some() {
        let new = format!("{}{table}{}", &document[..begin], &document[end..]);
        std::fs::write(path, new).expect("ARCHITECTURE.md can be written");
    } else {
        assert!(document[begin..end] == *table, "ARCHITECTURE.md's bind table is old; UPDATE_BIND_TABLE=1 renews it");
    }
}
