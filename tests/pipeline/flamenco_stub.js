// Plays Flamenco's manager, following its documented interface: node flamenco_stub.js JOB_TYPE.js SETTINGS.json
// prints the compiled tasks as JSON.
const fs = require("fs");
const vm = require("vm");
const nodePath = require("path");

const [script, settingsFile] = process.argv.slice(2);
const job = {
    settings: JSON.parse(fs.readFileSync(settingsFile)), tasks: [],
    addTask(task) { this.tasks.push(task); },
};

class Task {
    constructor(name, type) { Object.assign(this, { name, type, commands: [], dependencies: [] }); }
    addCommand(command) { this.commands.push(command); }
    addDependency(other) { this.dependencies.push(other.name); }
}

function frameChunker(frames, size) {
    const numbers = frames.split(",").flatMap(part => {
        const [first, last] = part.trim().split("-").map(Number);
        return Array.from({ length: (last ?? first) - first + 1 }, (_, index) => first + index);
    });
    if (size !== 1) throw new Error("this stub makes chunks of one frame");
    return numbers.map(String);
}

const context = vm.createContext({
    author: { Task: (name, type) => new Task(name, type), Command: (name, parameters) => ({ name, parameters }) },
    path: { join: nodePath.posix.join }, frameChunker,
});
vm.runInContext(fs.readFileSync(script, "utf-8") + "\nglobalThis.jobType = JOB_TYPE;", context);
context.compileJob(job);
console.log(JSON.stringify({ type: context.jobType, tasks: job.tasks }));
